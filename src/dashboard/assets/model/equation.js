// @ts-check
// This module writes the equations of a model as MathML. An equation that cannot be read is shown as
// its text.

const GREEK = {
  alpha: "α",
  beta: "β",
  gamma: "γ",
  delta: "δ",
  epsilon: "ε",
  zeta: "ζ",
  eta: "η",
  theta: "θ",
  kappa: "κ",
  lambda: "λ",
  mu: "μ",
  nu: "ν",
  xi: "ξ",
  pi: "π",
  rho: "ρ",
  sigma: "σ",
  tau: "τ",
  phi: "φ",
  chi: "χ",
  psi: "ψ",
  omega: "ω",
  Delta: "Δ",
  Omega: "Ω",
};
// A name may begin with the name of a Greek letter.
const GREEK_NAME = new RegExp(`^(${Object.keys(GREEK).join("|")})(?![a-z])`);
const RELATIONS = ["=", ">=", "<=", ">", "<", "==", "!=", ",", ":", ";"];
const SIGNS = { "*": "·", "-": "−", ">=": "≥", "<=": "≤", "!=": "≠", "==": "=" };
const TOKEN =
  /\s*([A-Za-z_\u0370-\u03ff][A-Za-z0-9_\u0370-\u03ff]*|\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+|>=|<=|==|!=|[-+*/^()=<>,:;'])/y;

// Reads an equation as a tree of [kind, …]; the answer is null where the equation is not understood.
export function parse(text) {
  const tokens = [];
  TOKEN.lastIndex = 0;
  while (TOKEN.lastIndex < text.trimEnd().length) {
    const match = TOKEN.exec(text);
    if (!match) {
      return null;
    }
    tokens.push(match[1]);
  }
  let at = 0;
  const peek = () => tokens[at];
  const line = () => {
    const parts = [sum()];
    while (RELATIONS.includes(peek())) {
      const relation = tokens[at++];
      parts.push(["relation", relation], sum());
    }
    return ["row", ...parts];
  };
  const sum = () => {
    let left = term();
    while (peek() === "+" || peek() === "-") {
      left = ["infix", tokens[at++], left, term()];
    }
    return left;
  };
  const term = () => {
    let left = sign();
    while (peek() === "*" || peek() === "/") {
      const operator = tokens[at++];
      left = operator === "/" ? ["fraction", left, sign()] : ["infix", "*", left, sign()];
    }
    return left;
  };
  const sign = () => (peek() === "-" || peek() === "+" ? ["prefix", tokens[at++], sign()] : power());
  const power = () => {
    const base = primed();
    if (peek() !== "^") {
      return base;
    }
    at += 1;
    return ["power", base, sign()];
  };
  const primed = () => {
    let inner = atom();
    while (peek() === "'") {
      let primes = 0;
      while (peek() === "'") {
        primes += 1;
        at += 1;
      }
      inner = ["primed", inner, primes];
    }
    return inner;
  };
  const atom = () => {
    const token = tokens[at++];
    if (token === "(") {
      const inner = line();
      if (tokens[at++] !== ")") {
        throw new SyntaxError(") is missing");
      }
      return ["group", inner];
    }
    if (token === undefined || !/^[\w.\u0370-\u03ff]/.test(token)) {
      throw new SyntaxError(`unexpected ${token}`);
    }
    if (/^[\d.]/.test(token)) {
      return ["number", token];
    }
    return peek() === "(" ? ["call", token, atom()] : ["name", token];
  };
  try {
    const tree = line();
    return at === tokens.length ? tree : null;
  } catch (error) {
    if (error instanceof SyntaxError) {
      return null;
    }
    throw error;
  }
}

// A letter has an index of a few letters or digits behind it; small letters alone are a word, as in `area`.
const INDEXED = /^([A-Z\u0370-\u03ff])([A-Za-z0-9]{0,3})$|^([a-z])([0-9]{0,3}|[A-Za-z][0-9]{0,2})$/;

// Splits a name into a base and a lowered index: `Km`, `p1`, `K_m` and `tau1` have an index.
export function parted(name) {
  const [, greek] = GREEK_NAME.exec(name) ?? [];
  if (greek) {
    return [GREEK[greek], name.slice(greek.length).replace(/^_/, "")];
  }
  if (name.includes("_")) {
    const [base, ...index] = name.split("_");
    return [base, index.join(" ")];
  }
  const [, capital, after, small, behind] = INDEXED.exec(name) ?? [];
  return capital || small ? [capital ?? small, after ?? behind] : [name, ""];
}

const MATH = "http://www.w3.org/1998/Math/MathML";

function make(tag, ...children) {
  const element = document.createElementNS(MATH, tag);
  element.append(...children);
  return element;
}

function identifier(name) {
  const [base, index] = parted(name);
  return index
    ? make("msub", make("mi", base), make(/^\d+$/.test(index) ? "mn" : "mtext", index))
    : make("mi", base);
}

const bare = (tree) => (tree[0] === "group" ? tree[1] : tree);

function element(tree) {
  const [kind, ...parts] = tree;
  switch (kind) {
    case "row":
      return make("mrow", ...parts.map(element));
    case "relation":
      return make("mo", SIGNS[parts[0]] ?? parts[0]);
    case "infix":
      return make("mrow", element(parts[1]), make("mo", SIGNS[parts[0]] ?? parts[0]), element(parts[2]));
    case "prefix":
      return make("mrow", make("mo", SIGNS[parts[0]] ?? parts[0]), element(parts[1]));
    case "fraction":
      return make("mfrac", element(bare(parts[0])), element(bare(parts[1])));
    case "power":
      return make("msup", element(parts[0]), element(bare(parts[1])));
    case "primed":
      return dotted(parts[0], parts[1]);
    case "group":
      return make("mrow", bracket("(", parts[0]), element(parts[0]), bracket(")", parts[0]));
    case "number":
      return make("mn", parts[0]);
    case "name":
      return identifier(parts[0]);
    default:
      return call(parts[0], parts[1]);
  }
}

// A bracket is as tall as its content only where the content has a fraction.
function bracket(sign, inner) {
  const drawn = make("mo", sign);
  drawn.setAttribute("stretchy", String(JSON.stringify(inner).includes('"fraction"')));
  return drawn;
}

// A derivative has dots above a single name and primes behind anything else.
function dotted(inner, primes) {
  if (inner[0] === "name" && primes <= 2) {
    const [base, index] = parted(inner[1]);
    const above = make("mover", make("mi", base), make("mo", primes === 1 ? "˙" : "¨"));
    return index ? make("msub", above, make("mtext", index)) : above;
  }
  return make("msup", element(inner), make("mo", "′".repeat(primes)));
}

function call(name, group) {
  if (name === "sqrt") {
    return make("msqrt", element(bare(group)));
  }
  if (name === "abs") {
    return make("mrow", make("mo", "|"), element(bare(group)), make("mo", "|"));
  }
  const [base, index] = parted(name);
  const plain =
    index === "" ||
    name.length > 4 ||
    ["exp", "sin", "cos", "tan", "tanh", "sign", "clip", "min", "max", "log"].includes(name);
  return make(
    "mrow",
    plain ? make("mi", GREEK[name] ?? name) : make("msub", make("mi", base), make("mtext", index)),
    element(group),
  );
}

// Makes an element of an equation, with its text for readers who do not see it.
export function equation(text) {
  const [, before, inner] = /^([a-z][a-z ]*): (.*)$/.exec(text) ?? [null, "", text];
  const [, rest, after] = /^(.*?)((?:, (?:[a-z]{4,}|[a-z]+ [a-z ]+))*)$/.exec(inner) ?? [null, inner, ""];
  const tree = parse(rest);
  const place = document.createElement("div");
  place.className = "equation";
  if (!tree) {
    const code = document.createElement("code");
    code.textContent = text;
    place.append(code);
    return place;
  }
  const math = make("math", element(tree));
  math.setAttribute("display", "inline");
  math.setAttribute("displaystyle", "true");
  math.setAttribute("aria-label", rest);
  place.append(...words(before ? `${before}: ` : ""), math, ...words(after));
  return place;
}

function words(text) {
  if (!text) {
    return [];
  }
  const element = document.createElement("span");
  element.className = "quiet";
  element.textContent = text;
  return [element];
}
