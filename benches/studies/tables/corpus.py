"""What becomes of the tables that plants have: each is stored without options, asked about as often as the
server asks, and the recording is read back beside the truth of its generator.

    python3 benches/studies/tables/corpus.py [--only source,source] [--variant name] [--show] [--json file]

Prints a table by source and each variant that was not read; fails where one was read wrong without a word.
"""

import importlib
import json
import os
import re
import sys
import urllib.error
import urllib.parse
import urllib.request
from collections import Counter
from datetime import datetime
from fractions import Fraction

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
import served  # noqa: E402

FAMILIES = (
    "spreadsheets",
    "locales",
    "workbooks",
    "notebooks",
    "languages",
    "loggers",
    "instruments",
    "automation",
    "panels",
    "historians",
    "exports",
    "agents",
    "clouds",
    "columnar",
    "oddities",
    "qualities",
    "units",
)
CLASSES = ("read", "asked_then_read", "refused", "warned_wrong", "silent")
# Warnings on what a recording is like, which say nothing on how it was read.
ODDITIES = {
    "missing_samples",
    "gap",
    "frozen_signal",
    "saturated_signal",
    "spike",
    "constant_signal",
    "bad_samples",
    "uncertain_samples",
    "irregular_sampling",
    "few_samples",
}
# Warnings on a signal without a unit say nothing on its values.
ON_UNITS = {"no_unit", "unit_remark"}


def asked(address, path, body=None, content_type=None):
    """The status and the answer as JSON."""
    headers = {"content-type": content_type} if content_type else {}
    request = urllib.request.Request(f"{address}/v1/{path}", data=body, headers=headers)
    try:
        with urllib.request.urlopen(request, timeout=120) as answer:
            return answer.status, json.load(answer)
    except urllib.error.HTTPError as refusal:
        with refusal:
            return refusal.code, json.load(refusal)


def posted(address, variant, options):
    query = "datasets?" + urllib.parse.urlencode(options) if options else "datasets"
    return asked(address, query, variant.body, variant.content_type)


def words_of(problem):
    """All text of a refusal."""
    faults = problem.get("errors", [])
    texts = [problem.get("detail", "")] + [fault.get("detail", "") for fault in faults]
    texts += [f"`{fault['parameter']}`" for fault in faults if "parameter" in fault]
    return " / ".join(text for k, text in enumerate(texts) if not any(text in before for before in texts[:k]))


def named(words, answers):
    """The options among `answers` that a refusal names."""
    return [option for option in answers if re.search(rf"`{option}\b|\b{option}=|\bsay (its )?{option}\b", words)]


def squeezed(name):
    return re.sub(r"[^a-z0-9]", "", name.lower())


def unit_key(unit):
    table = {"³": "3", "²": "2", "^": "", "⋅": "·"}
    return "".join(table.get(letter, letter) for letter in unit)


def matched(truth, stored, samples):
    """The stored name of each true signal: the same one, or one that holds it and has its numbers."""
    matches, free = {}, list(stored)
    for name, signal in truth.signals.items():
        for candidate in (name, *signal["names"]):
            if candidate in free:
                matches[name] = candidate
                free.remove(candidate)
                break
    for name in truth.signals:
        if name not in matches:
            close = [s for s in free if squeezed(name) and squeezed(name) in squeezed(s)]
            close.sort(key=lambda s: -alike(truth.signals[name]["values"], samples["signals"][s]["values"]))
            if close:
                matches[name] = close[0]
                free.remove(close[0])
    return matches, free


def alike(true, values):
    """How many of the true values stand among the stored ones."""
    stored = {f"{value:.6g}" for value in values if value is not None}
    return sum(f"{value:.6g}" in stored for value in true.values() if value is not None)


def differences(address, variant, shown):
    """What of a recording is not so: pairs of a topic (a signal's name, or `time`) and a sentence."""
    truth = variant.truth
    status, samples = asked(address, f"datasets/{shown['id']}/samples?max_points=100000")
    if status != 200:
        return [("time", f"samples answer {status}")]
    faults = []
    times = [Fraction(t) for t in samples["time_s"]]
    instants = sorted({t for s in truth.signals.values() for t, v in s["values"].items() if v is not None})
    every = sorted({t for s in truth.signals.values() for t in s["values"]})
    duration = float(every[-1] - every[0])
    tolerance = truth.tolerance or max(1e-9 * duration, 2e-9)
    origin = Fraction(0)
    if truth.is_absolute:
        if shown["start"] is None:
            faults.append(("time", "the date is lost: `start` is null"))
            origin = every[0]
        else:
            origin = epoch(shown["start"])
    else:
        origin = every[0]
        if shown["start"] is not None:
            faults.append(("time", f"a date is invented: start {shown['start']}"))
    placed = places(instants, [origin + t for t in times], tolerance)
    if placed is None and origin != instants[0]:
        placed = places(instants, [instants[0] + t for t in times], tolerance)
        if placed is not None and truth.is_absolute:
            faults.append(("time", f"start is {float(origin - instants[0]):+} s off: {shown['start']}"))
    if placed is None:
        first = [float(t) for t in times[:4]]
        return faults + [
            (
                "time",
                f"instants differ: {len(times)} stored, {len(instants)} true; start "
                f"{shown['start']}, first {first}, true {[float(t - every[0]) for t in instants[:4]]}",
            )
        ]
    stored = {s["name"]: s for s in shown["signals"]}
    matches, free = matched(truth, stored, samples)
    is_on_grid = any(w["code"] == "put_on_grid" for w in shown["report"]["warnings"])
    free = [name for name in free if not any(re.fullmatch(h, name) for h in variant.harmless)]
    for name in free:
        faults.append((name, f"a signal `{name}` that the file does not have"))
    for name, signal in truth.signals.items():
        if name not in matches:
            faults.append((name, f"signal `{name}` is lost; stored are {list(stored)}"))
            continue
        unit = stored[matches[name]]["unit"]
        if unit_key(unit) != unit_key(signal["unit"]):
            faults.append((matches[name], f"`{name}` has the unit `{unit}`, not `{signal['unit']}`"))
            continue
        values = samples["signals"][matches[name]]["values"]
        faults += wrong_values(name, matches[name], signal["values"], values, placed, is_on_grid)
    return faults


def wrong_values(name, topic, true, values, placed, is_on_grid):
    for instant, value in true.items():
        place = placed.get(instant)
        got = None if place is None else values[place]
        if value is None and (got is None or is_on_grid):
            continue
        if value is not None and got is not None and abs(got - value) <= 1e-9 * max(abs(value), 1e-12):
            continue
        return [(topic, f"`{name}` is {got}, not {value}, at {float(instant)} s")]
    strangers = [] if is_on_grid else [p for t, p in placed.items() if t not in true and values[p] is not None]
    if strangers:
        return [(topic, f"`{name}` has a value at an instant without a sample: {values[strangers[0]]}")]
    return []


def epoch(text):
    text = text.replace("Z", "+00:00")
    digits = re.search(r"\.(\d+)", text)
    whole = datetime.fromisoformat(text.replace(digits[0], "") if digits else text)
    return Fraction(round(whole.timestamp())) + (Fraction(int(digits[1]), 10 ** len(digits[1])) if digits else 0)


def places(instants, times, tolerance):
    """The place of each instant among the stored times; None where one has none."""
    place_of, position = {}, 0
    for instant in instants:
        while position < len(times) and float(times[position] - instant) < -tolerance:
            position += 1
        if position == len(times) or float(times[position] - instant) > tolerance:
            return None
        place_of[instant] = position
    return place_of


def judged(address, variant):
    """The class of a variant and the words that go with it."""
    options, trail = {}, []
    status, answer = posted(address, variant, options)
    while status >= 400 and len(options) < len(variant.answers):
        words = words_of(answer)
        trail.append(words)
        new = [option for option in named(words, variant.answers) if option not in options]
        if not new:
            break
        options.update({option: variant.answers[option] for option in new})
        status, answer = posted(address, variant, options)
    if status >= 400:
        return refusal(address, variant, answer, options, trail)
    return compared(address, variant, answer, options, trail)


def compared(address, variant, shown, options, trail):
    """The class of a variant that was stored."""
    warnings = shown["report"]["warnings"]
    faults = differences(address, variant, shown)
    sentences = [f"[{w['code']}] {w.get('signal') or ''}: {w['detail']}" for w in warnings]
    unasked = [o for o in variant.must_ask if o not in options and not any(o in word for word in sentences)]
    if unasked and not faults:
        faults = [("time", f"guessed without a word on {', '.join(unasked)}")]
    if not faults:
        return ("asked_then_read" if options else "read"), {"options": options, "asked": trail}
    explained = [text for topic, text in faults if is_told(topic, text, warnings)]
    kind = "warned_wrong" if len(explained) == len(faults) else "silent"
    return kind, {"faults": [text for _, text in faults], "warnings": sentences, "options": options, "asked": trail}


def is_told(topic, text, warnings):
    """Whether a warning on how the file was read is about a fault; candidates for a person to look at."""
    is_on_unit = "has the unit" in text
    for warning in warnings:
        if warning["code"] in ODDITIES or warning["code"] in ON_UNITS and not is_on_unit:
            continue
        if topic == "time" and re.search(r"time|clock|instant|date|zone|row|sample", warning["detail"]):
            return True
        about = warning.get("signal") or ""
        if topic != "time" and (about == topic or f"`{topic}`" in warning["detail"]):
            return True
        if warning["code"] == "duplicate_time":
            return True
        # A column beside a signal, such as one of its quality, may have been kept aside.
        if topic != "time" and warning["code"] == "text_column" and topic in about:
            return True
        # A column that was left out may be the one that says which values are bad.
        if topic != "time" and warning["code"] == "left_out_columns":
            return True
    return False


def refusal(address, variant, answer, options, trail):
    """A refusal that names none of the answers left: whether all of them at once help is told beside it."""
    detail = {
        "asked": trail,
        "words": words_of(answer)[:600],
        "options": options,
        "note": "no option helps",
        "code": [fault["code"] for fault in answer.get("errors", [])][:3],
    }
    status, helped = posted(address, variant, variant.answers) if variant.answers else (400, answer)
    if status >= 400:
        if variant.answers:
            detail["note"] = f"with {variant.answers}: {words_of(helped)[:300]}"
        return "refused", detail
    kind, read = compared(address, variant, helped, variant.answers, trail)
    if kind in ("warned_wrong", "silent"):
        return kind, {**detail, **read, "note": f"no fault names it, and read wrong with {variant.answers}"}
    detail["note"] = f"{variant.answers} helps, but no fault names it"
    return "refused", detail


def all_variants(sources):
    for family in FAMILIES:
        try:
            module = importlib.import_module(family)
        except ModuleNotFoundError as absent:
            if absent.name == family:
                continue
            print(f"{family} is left out: {absent.name} is not installed", file=sys.stderr)
            continue
        for variant in module.variants():
            if not sources or variant.source in sources:
                yield variant


def listed(variant, kind, detail, is_shown):
    print(f"\n## {kind}: {variant.source} / {variant.name} ({variant.level})")
    for text in detail.get("faults", []):
        print("  wrong:", text)
    for key in ("warnings", "asked"):
        for text in detail.get(key, [])[:8]:
            print(f"  {key}:", text[:500])
    for key in ("code", "words", "note", "options"):
        if detail.get(key):
            print(f"  {key}:", detail[key])
    if is_shown:
        print("  | " + "\n  | ".join(variant.body[:900].decode("utf-8", "replace").splitlines()[:9]))


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--only", help="names of sources, separated by commas")
    parser.add_argument("--variant", help="part of a variant's name")
    parser.add_argument("--show", action="store_true", help="the first lines of each payload that was not read")
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment(["pyarrow", "openpyxl"], "greybox-tables")
    sources = options.only.split(",") if options.only else []
    counts, levels, figures = {}, Counter(), []
    with served.Server(options) as server:
        for variant in all_variants(sources):
            if options.variant and options.variant not in variant.name:
                continue
            kind, detail = judged(server.address, variant)
            counts.setdefault(variant.source, Counter())[kind] += 1
            levels[variant.level, kind] += 1
            figures.append(
                {"source": variant.source, "name": variant.name, "level": variant.level, "class": kind, **detail}
            )
            if kind not in ("read", "asked_then_read"):
                listed(variant, kind, detail, options.show)
    total = sum(counts.values(), Counter())
    rows = [("source", "variants", *CLASSES)]
    rows += [(name, sum(c.values()), *(c[k] or "" for k in CLASSES)) for name, c in sorted(counts.items())]
    rows += [
        (f"all {level}", sum(levels[level, k] for k in CLASSES), *(levels[level, k] for k in CLASSES))
        for level in ("clean", "typical", "nasty")
    ]
    rows.append(("all", sum(total.values()), *(total[k] for k in CLASSES)))
    print("\n" + served.table(rows))
    served.keep(options, figures)
    sys.exit(1 if total["silent"] else 0)


if __name__ == "__main__":
    main()
