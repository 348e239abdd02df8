// @ts-check
// A job while it is put together. The specification itself is what is kept: forms and JSON are two
// views of it. Pure, so that it can be tested without a page.

// How well a recorded signal stands for one of the model: by name, symbol and unit.
export function likeness(wanted, recorded) {
  const plain = (text) => (text ?? "").toLowerCase().replace(/[^a-z0-9]/g, "");
  const [own, other] = [plain(wanted.name), plain(recorded.name)];
  const units = unitsAgree(wanted.unit, recorded.unit);
  if (units === false) {
    return own === other ? 4 : -1;
  }
  const unit = units ? 2 : 0;
  if (wanted.name === recorded.name) {
    return 10 + unit;
  }
  if (own === other) {
    return 9 + unit;
  }
  const shared = wanted.name.toLowerCase().split(/[^a-z0-9]+/).filter((word) => word.length > 2 && other.includes(word)).length;
  const within = own.length > 2 && other.length > 2 && (own.includes(other) || other.includes(own));
  const symbol = wanted.symbol && plain(wanted.symbol) === other;
  return (symbol ? 6 : 0) + (within ? 4 : 0) + shared + unit;
}

// Whether two units are the same; null where one of them is not known.
function unitsAgree(one, other) {
  const plain = (unit) => (unit === "1" ? "" : unit ?? "").replaceAll("²", "2").replaceAll("³", "3").replace(/[\^·*\s]/g, "");
  return other === "" || other === undefined ? null : plain(one) === plain(other);
}

// The signals that a model needs and measures, in the set of inputs that suits the recording best:
// { signals: {model: recorded}, inputs: [names of the set] }.
export function suggestSignals(model, recorded) {
  const sets = model.input_sets?.length ? model.input_sets : [model.inputs.map(({ name }) => name)];
  const tried = sets.map((inputs) => {
    const wanted = [...model.inputs.filter(({ name }) => inputs.includes(name)), ...model.outputs];
    const { signals, score } = assigned(wanted, recorded);
    const driven = inputs.filter((name) => signals[name]).length;
    return { inputs, signals, score: score + (driven === inputs.length ? 20 : 0) };
  });
  return tried.reduce((best, of) => (of.score > best.score ? of : best));
}

// The likeliest pairs first, each recorded signal for one of the model.
function assigned(wanted, recorded) {
  const pairs = wanted.flatMap((own) => recorded.map((other) => [likeness(own, other), own.name, other.name]))
    .filter(([score]) => score >= 2).sort((a, b) => b[0] - a[0]);
  const signals = {};
  let score = 0;
  for (const [likely, own, other] of pairs) {
    if (!(own in signals) && !Object.values(signals).includes(other)) {
      signals[own] = other;
      score += likely;
    }
  }
  return { signals, score };
}

// The set of inputs whose signals an experiment names, else the first.
export function inputSet(model, signals) {
  const sets = model.input_sets?.length ? model.input_sets : [model.inputs.map(({ name }) => name)];
  const named = (set) => set.filter((name) => signals?.[name]).length;
  return sets.reduce((best, set) => (named(set) > named(best) || (named(set) === named(best) && set.length < best.length && named(set) === set.length) ? set : best));
}

export function experimentOf(dataset, model) {
  const signals = model ? suggestSignals(model, dataset.signals).signals : {};
  return { dataset: dataset.id, signals };
}

// The same specification for another model: what was said of parameters, outputs and states was said
// of the old one.
export function withModel(spec, model, datasets) {
  const { parameters, outputs, model_search: search, constraints, priors, ...rest } = spec;
  const experiments = (spec.experiments ?? []).map((experiment) => {
    const known = datasets.get(experiment.dataset);
    const { parameters: own, initial_state: states, ...kept } = experiment;
    return { ...kept, signals: known ? suggestSignals(model, known.signals).signals : {} };
  });
  return { ...rest, model: model.name, experiments };
}

// The specification with another value at a path, `undefined` to leave it out; objects that are then
// empty are left out too.
/**
 * @param {any} value
 * @param {(string | number)[]} path
 * @param {any} to
 * @returns {any}
 */
export function changed(value, path, to) {
  const [key, ...rest] = path;
  const base = Array.isArray(value) ? [...value] : { ...value };
  const next = rest.length ? changed(value?.[key] ?? (typeof rest[0] === "number" ? [] : {}), rest, to) : to;
  const gone = next === undefined || (rest.length > 0 && isEmpty(next));
  if (Array.isArray(base)) {
    gone && !rest.length ? base.splice(Number(key), 1) : (base[key] = next);
  } else if (gone) {
    delete base[key];
  } else {
    base[key] = next;
  }
  return base;
}

function isEmpty(value) {
  return value !== null && typeof value === "object" && !Array.isArray(value) && Object.keys(value).length === 0;
}

// What is known of each parameter of a model: what the specification says, else the model.
export function parameterRows(model, said = {}) {
  return model.parameters.map((about) => {
    const entry = said[about.name];
    const free = entry ? "estimate" in entry : about.unknown_by_default;
    return {
      about, said: entry !== undefined, free,
      value: entry?.value ?? about.default,
      tolerance: entry?.tolerance ?? "",
      lower: entry?.estimate?.lower ?? about.lower, upper: entry?.estimate?.upper ?? about.upper,
      scale: entry?.estimate?.scale ?? about.scale, prior: entry?.prior ?? null,
    };
  });
}

// What a specification says of a row: nothing where that is what the model says anyway.
export function entryOf(row) {
  const { about } = row;
  if (!row.free) {
    const entry = { value: row.value };
    if (row.tolerance !== "" && row.tolerance !== null && row.tolerance !== undefined) {
      entry.tolerance = toleranceOf(row.tolerance);
    }
    const usual = !about.unknown_by_default && row.value === about.default && entry.tolerance === undefined;
    return usual ? undefined : entry;
  }
  const estimate = {};
  for (const side of ["lower", "upper", "scale"]) {
    if (row[side] !== about[side]) {
      estimate[side] = row[side];
    }
  }
  const entry = row.prior ? { estimate, prior: row.prior } : { estimate };
  const usual = about.unknown_by_default && Object.keys(estimate).length === 0 && !row.prior;
  return usual ? undefined : entry;
}

// `1 %` stays a share; `0.5` becomes a number in the parameter's unit.
function toleranceOf(text) {
  if (typeof text === "number") {
    return text;
  }
  const bare = text.trim();
  return bare.endsWith("%") || Number.isNaN(Number(bare)) ? bare : Number(bare);
}

// `site=hall 2, rig=4` as labels, and back.
export function labelsOf(text) {
  const pairs = text.split(",").map((pair) => pair.trim()).filter(Boolean).map((pair) => {
    const [, name, value] = /^([^=:]*)[=:]?(.*)$/.exec(pair);
    return [name.trim(), value.trim()];
  }).filter(([name]) => name);
  return pairs.length ? Object.fromEntries(pairs) : undefined;
}

export function labelText(labels) {
  return Object.entries(labels ?? {}).map(([name, value]) => (value ? `${name}=${value}` : name)).join(", ");
}

// `tau1 < tau2; k1 + k2 <= 1` as conditions, and back.
export function conditionsOf(text) {
  const conditions = text.split(";").map((one) => one.trim()).filter(Boolean);
  return conditions.length ? conditions : undefined;
}

export function conditionText(conditions) {
  return (conditions ?? []).join("; ");
}

// What a job found of its parameters, as a prior of all of them together for the next one; undefined
// where it fixed none.
/** @param {{ parameters: any[], correlation?: any }} result */
export function priorOfResult({ parameters, correlation }) {
  const error = (own) => own.total_standard_error ?? own.standard_error;
  const known = parameters.filter((own) => (own.experiment ?? null) === null && error(own) > 0);
  if (known.length === 0) {
    return undefined;
  }
  const names = known.map(({ name }) => name);
  const prior = { parameters: names, mean: known.map(({ estimate }) => estimate), std: known.map(error) };
  const places = names.map((name) => (correlation?.names ?? []).indexOf(name));
  const between = (a, b) => (a === b ? 1 : correlation?.matrix[a]?.[b] ?? 0);
  return places.includes(-1) ? prior : { ...prior, correlation: places.map((a) => places.map((b) => between(a, b))) };
}

// A number as people type it: with a decimal comma too; NaN where it is none.
export function numberOf(text) {
  const bare = String(text).trim().replace(/[\s\u202f\u00a0]/g, "").replace("−", "-").replace(",", ".");
  return bare === "" ? NaN : Number(bare);
}

// A specification for another page of this tab, and the name that it is found by there.
export function keep(spec) {
  const key = `prepared-${Date.now().toString(36)}`;
  sessionStorage.setItem(key, JSON.stringify(spec));
  return key;
}
