// @ts-check
// This module finds out which signal of a recording stands for which signal of a model. Its functions
// are pure, so that they can be tested without a page.

// The likeness tells how well a recorded signal suits a signal of the model by name, symbol and unit.
export function likeness(signal, recorded) {
  const plain = (text) => (text ?? "").toLowerCase().replace(/[^a-z0-9]/g, "");
  const [name, recordedName] = [plain(signal.name), plain(recorded.name)];
  const units = unitsAgree(signal.unit, recorded.unit);
  if (units === false) {
    return name === recordedName ? 4 : -1;
  }
  const unit = units ? 2 : 0;
  if (signal.name === recorded.name) {
    return 10 + unit;
  }
  if (name === recordedName) {
    return 9 + unit;
  }
  const shared = signal.name
    .toLowerCase()
    .split(/[^a-z0-9]+/)
    .filter((word) => word.length > 2 && recordedName.includes(word)).length;
  const within =
    name.length > 2 &&
    recordedName.length > 2 &&
    (name.includes(recordedName) || recordedName.includes(name));
  const symbol = signal.symbol && plain(signal.symbol) === recordedName;
  return (symbol ? 6 : 0) + (within ? 4 : 0) + shared + unit;
}

// Answers whether two units are the same; the answer is null where the recorded unit is not known.
function unitsAgree(unit, recordedUnit) {
  const plain = (unit) =>
    (unit === "1" ? "" : (unit ?? ""))
      .replaceAll("²", "2")
      .replaceAll("³", "3")
      .replace(/[\^·*\s]/g, "");
  return recordedUnit === "" || recordedUnit === undefined ? null : plain(unit) === plain(recordedUnit);
}

// Suggests recorded signals for the inputs and outputs of a model, in the set of inputs that suits the
// recording best: { signals: { model: recorded }, inputs: [names of the set] }.
export function suggestSignals(model, recorded) {
  const sets = model.input_sets?.length ? model.input_sets : [model.inputs.map(({ name }) => name)];
  const candidates = sets.map((inputs) => {
    const signalsOfModel = [...model.inputs.filter(({ name }) => inputs.includes(name)), ...model.outputs];
    const { signals, score } = assigned(signalsOfModel, recorded);
    const driven = inputs.filter((name) => signals[name]).length;
    return { inputs, signals, score: score + (driven === inputs.length ? 20 : 0) };
  });
  return candidates.reduce((best, candidate) => (candidate.score > best.score ? candidate : best));
}

// The likeliest pairs are assigned first; each recorded signal is assigned once.
function assigned(signalsOfModel, recorded) {
  const pairs = signalsOfModel
    .flatMap((signal) => recorded.map((column) => [likeness(signal, column), signal.name, column.name]))
    .filter(([score]) => score >= 2)
    .sort((a, b) => b[0] - a[0]);
  const signals = {};
  let score = 0;
  for (const [likely, name, recordedName] of pairs) {
    if (!(name in signals) && !Object.values(signals).includes(recordedName)) {
      signals[name] = recordedName;
      score += likely;
    }
  }
  return { signals, score };
}

// The set of inputs is the set whose signals an experiment names, else the first set.
export function inputSet(model, signals) {
  const sets = model.input_sets?.length ? model.input_sets : [model.inputs.map(({ name }) => name)];
  const named = (set) => set.filter((name) => signals?.[name]).length;
  return sets.reduce((best, set) =>
    named(set) > named(best) ||
    (named(set) === named(best) && set.length < best.length && named(set) === set.length)
      ? set
      : best,
  );
}
