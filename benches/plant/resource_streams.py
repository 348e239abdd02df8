"""Streams and monitors of a server that is killed."""

import datetime
import json
import math
import random

from acknowledged import Kind

KEY = "idempotency-key"
START = datetime.datetime(2026, 3, 2, 8, tzinfo=datetime.timezone.utc)
SIGNALS = ("command", "position")
CSV = {"content-type": "text/csv"}
# Samples of a batch, and of a stream that is removed then.
LONGEST_BATCH, LONGEST_STREAM = 30, 700
# The longest time from a sample to the next [ms].
LONGEST_STEP_MS = 2000


def instant(ms):
    """The instant that lies so many milliseconds after the start, as text."""
    moment = START + datetime.timedelta(milliseconds=ms)
    return moment.strftime("%Y-%m-%dT%H:%M:%S.") + f"{moment.microsecond // 1000:03d}Z"


def milliseconds(text):
    """How long an instant lies after the start [ms]."""
    body = text.removesuffix("Z")
    whole, _, fraction = body.partition(".")
    moment = datetime.datetime.fromisoformat(whole).replace(tzinfo=datetime.timezone.utc)
    return int((moment - START).total_seconds()) * 1000 + int((fraction + "000")[:3])


def long_csv(samples):
    rows = (f"{instant(ms)},{SIGNALS[signal]},{value}\n" for signal, ms, value in samples)
    return "timestamp,tag,value\n" + "".join(rows)


class Batch:
    def __init__(self, samples, key):
        self.samples, self.key, self.body, self.answer = samples, key, long_csv(samples), None

    def merged(self, values):
        """The values of a stream that has taken the batch."""
        return {**values, **{(signal, ms): value for signal, ms, value in self.samples}}

    def instants(self):
        return {ms for _, ms, _ in self.samples}


class Streams(Kind):
    """A stream after the other, to which batches come in order, late, repeated and corrected."""

    name = "streams"

    def __init__(self, plant):
        super().__init__(plant)
        self.begin_stream()

    def begin_stream(self):
        self.number += 1
        self.path = f"/v1/streams/rig-{self.number}"
        # The values that were acknowledged by signal and instant; nothing where there is no stream.
        self.values, self.batches, self.next_ms, self.keys = None, [], 0, 0
        # The values where the call that was cut off has happened, and what to send again.
        self.after, self.is_cut, self.resend = None, False, None

    def samples(self, from_ms):
        samples, ms = [], from_ms
        for _ in range(self.random.randint(1, LONGEST_BATCH)):
            ms += self.random.randint(1, LONGEST_STEP_MS)
            samples.append((self.random.randrange(len(SIGNALS)), ms, round(self.random.random(), 4)))
        return samples

    def draw_batch(self):
        draw = self.random.random()
        if draw < 0.5 or not self.batches:
            sort, samples = "in order", self.samples(self.next_ms)
            # Gaps are left now and then, for late batches.
            self.next_ms += LONGEST_BATCH * LONGEST_STEP_MS * self.random.randint(1, 2)
        elif draw < 0.65:
            sort, samples = "late", self.samples(self.random.randrange(self.next_ms))
        else:
            sort, samples = "repeated", self.random.choice(self.batches).samples
            if draw < 0.85:
                sort, samples = "corrected", [(signal, ms, value + 1) for signal, ms, value in samples]
        self.keys += 1
        key = f"{self.path} {self.keys}" if self.random.random() < 0.5 else None
        return sort, Batch(samples, key)

    def act(self, client):
        draw, values = self.random.random(), self.values
        if values is not None and len(values) > LONGEST_STREAM:
            self.remove_stream(client)
        elif values and draw < 0.12:
            self.remove_part(client)
        elif draw < 0.22 and any(batch.key for batch in self.batches):
            self.replay(client, self.random.choice([batch for batch in self.batches if batch.key]))
        else:
            sort, batch = self.draw_batch()
            self.append(client, batch, sort)

    def append(self, client, batch, sort):
        before = self.values or {}
        self.after, self.is_cut, self.resend = batch.merged(before), True, batch if batch.key else None
        headers = {**CSV, KEY: batch.key} if batch.key else CSV
        status, told = self.call(client, "POST", self.path, batch.body, headers, accept=(200, 201))
        self.judge_answer(batch, before, status, told)
        batch.answer = told
        self.acknowledge(self.after, sort)
        self.batches.append(batch)

    def acknowledge(self, values, call):
        self.values, self.after, self.is_cut, self.resend = values, None, False, None
        self.touch(self.path)
        self.count(call)

    def judge_answer(self, batch, before, status, told):
        there = {ms for _, ms in before}
        instants = batch.instants()
        numbers = (told["added"], told["added"] + told["changed"] + told["repeated"])
        wanted = (len(instants - there), len(instants))
        if numbers != wanted:
            self.fault("changed", f"a batch to {self.path} adds {wanted[0]} of {wanted[1]} instants and was told", told)
        if (status == 201) != (self.values is None):
            self.fault("contradicted", f"a batch to {self.path}, there: {self.values is not None}, came to {status}")
        if status == 201:
            self.count("made")

    def replay(self, client, batch):
        """A batch whose key came before changes nothing and is answered as it was."""
        _, told = self.call(client, "POST", self.path, batch.body, {**CSV, KEY: batch.key}, accept=(200, 201))
        self.count("replayed")
        self.touch(self.path)
        if told != batch.answer:
            self.fault("doubled", f"the key {batch.key} was answered {json.dumps(batch.answer)} and now", told)

    def remove_part(self, client):
        instants = sorted({ms for _, ms in self.values})
        first = self.random.choice(instants)
        last = first + self.random.randint(1, 20) * LONGEST_STEP_MS
        gone = {ms for ms in instants if first <= ms < last}
        self.after, self.is_cut = {place: value for place, value in self.values.items() if place[1] not in gone}, True
        path = f"{self.path}/samples?from={instant(first)}&to={instant(last)}"
        _, told = self.call(client, "DELETE", path, accept=(200,))
        if told["removed"] != len(gone):
            self.fault("changed", f"{path} removes {len(gone)} samples and told", told)
        self.acknowledge(self.after, "parts removed")

    def remove_stream(self, client):
        self.after, self.is_cut = None, True
        self.call(client, "DELETE", self.path, accept=(204,))
        self.count("deleted")
        self.end_stream()

    def end_stream(self):
        self.gone.append(self.path)
        self.gone_paths.add(self.path)
        self.touch(self.path)
        self.begin_stream()

    def check(self, client):
        if self.is_cut:
            self.settle_call(client)
        super().check(client)

    def settle_call(self, client):
        """A call that was cut off has happened wholly or not at all."""
        shown = self.stored(client)
        batch = self.resend
        if shown == self.after:
            if self.after is None:
                self.end_stream()
                return
            self.values = self.after
        elif shown != self.values:
            self.report(self.values, shown, f" and not as {self.differences(self.after, shown)} either")
            self.values = shown
        self.after, self.is_cut, self.resend = None, False, None
        if batch is not None:
            self.send_again(client, batch)

    def send_again(self, client, batch):
        """A batch with a key that was cut off is sent again and counts once."""
        self.after, self.is_cut, self.resend = batch.merged(self.values or {}), True, batch
        _, batch.answer = self.call(client, "POST", self.path, batch.body, {**CSV, KEY: batch.key}, accept=(200, 201))
        self.acknowledge(self.after, "sent again")
        self.batches.append(batch)

    def stored(self, client):
        """The values that the stream holds, or nothing where there is no stream."""
        status, shown = self.call(client, "GET", self.path, accept=(200, 404))
        if status == 404:
            return None
        if shown["samples"] == 0:
            return {}
        _, _ = self.call(client, "GET", self.path, headers={"accept": "text/csv"}, accept=(200,))
        lines = client.text.decode().splitlines()
        places = [SIGNALS.index(name) for name in lines[0].split(",")[1:]]
        first, values = milliseconds(shown["first"]), {}
        for line in lines[1:]:
            time_s, *texts = line.split(",")
            ms = first + round(float(time_s) * 1000)
            values.update({(place, ms): float(text) for place, text in zip(places, texts) if text})
        return values

    @staticmethod
    def differences(values, shown):
        values, shown = values or {}, shown or {}
        missing = [place for place in values if place not in shown]
        added = [place for place in shown if place not in values]
        other = [(place, value, shown[place]) for place, value in values.items() if shown.get(place, value) != value]
        return (f"{len(missing)} missing {missing[:3]}, {len(added)} more {added[:3]}, {len(other)} other "
                f"{other[:3]}")

    def report(self, values, shown, more=""):
        lost = shown is None or any(place not in shown for place in values or {})
        self.fault("lost" if lost else "changed", f"{self.path} holds {self.differences(values, shown)}{more}")

    def look(self, client, path):
        if path != self.path:
            super().look(client, path)
            return
        shown = self.stored(client)
        if shown != self.values:
            self.report(self.values, shown)
            self.values = shown

    def check_all(self, client):
        super().check_all(client)
        if not self.is_cut:
            self.look(client, self.path)


# Samples of a window of a monitor, and the time from one to the next.
WINDOW_SAMPLES, SAMPLE_TIME_S = 50, 0.1
WINDOW_MS = round(WINDOW_SAMPLES * SAMPLE_TIME_S * 1000)
# Windows of a monitor, and the different streams that monitors watch.
WINDOWS, VARIANTS = 6, 4
MONITORED = {
    "model": {
        "name": "lag",
        "inputs": {"u": {"unit": "V"}},
        "parameters": {"time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1, "upper": 10, "scale": "log",
                                "unknown": True},
                       "gain": {"symbol": "K", "unit": "", "default": 1, "lower": 0.1, "upper": 10, "unknown": True}},
        "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
        "outputs": {"y": {"unit": "V", "expression": "x"}}},
    "experiments": [{"initial_state": {"x": {"estimate": {"lower": -5, "upper": 5}}}}],
    "outputs": {"y": {"noise_std": 0.0144}},
    "method": {"population": 8, "generations": 4, "further_searches": 0},
    "process_noise": "none",
}


def window(variant, number):
    """The samples of a window: a lag of 1 s and of the gain 2, under a square wave."""
    draw, decay = random.Random(f"{variant} {number}"), math.exp(-SAMPLE_TIME_S)
    # Each window begins where the one before ended; that of a settled square wave is the same.
    output = -2 * (1 - math.exp(-2.5)) / (1 + math.exp(-2.5))
    inputs, outputs = [], []
    for k in range(WINDOW_SAMPLES):
        level = 1.0 if (k // 25) % 2 == 0 else -1.0
        inputs.append(level)
        outputs.append(round(output + 0.05 * (draw.random() - 0.5), 6))
        output = 2 * level + (output - 2 * level) * decay
    return {"start": instant(number * WINDOW_MS), "sample_time_s": SAMPLE_TIME_S,
            "signals": {"u": {"unit": "V", "values": inputs}, "y": {"unit": "V", "values": outputs}}}
