"""Recordings, models, mappings and lines of agents of a server that is killed."""

from acknowledged import Kind, digest
from resource_streams import START, milliseconds
from server import carriage

# Things of a kind that are there before some are removed.
MOST = 12
MS_IN_NS = 1_000_000


class Documents(Kind):
    """Things that are made by one call, never change, and are removed by another."""

    path = ""

    def draw_document(self):
        """The path, the body and the headers of a creation, and what is noted of it."""
        raise NotImplementedError

    def name_of(self, answer):
        raise NotImplementedError

    def act(self, client):
        draw = self.random.random()
        if len(self.things) < 3 or (draw < 0.45 and len(self.things) < MOST):
            self.number += 1
            self.pending = self.draw_document()
            self.settle(client)
        elif draw < 0.6:
            self.make_again(client, self.some())
        elif draw < 0.8:
            self.look(client, self.some().path)
        else:
            self.remove(client, self.some())

    def settle(self, client):
        """Makes a thing; where that was cut off the same call comes to the same thing."""
        path, body, headers, facts = self.pending
        _, answer = self.call(client, "POST", path, body, headers, accept=(200, 201))
        self.pending = None
        self.count("made")
        shown = f"{self.path}/{self.name_of(answer)}"
        if shown in self.things or shown in self.gone_paths:
            self.fault("doubled", f"two documents came to {shown}")
        self.keep(shown, call=(path, body, headers), shown=None, **facts)

    def make_again(self, client, thing):
        """The same document is there already."""
        _, answer = self.call(client, "POST", *thing.call, accept=(200,))
        self.count("repeated")
        if f"{self.path}/{self.name_of(answer)}" != thing.path:
            self.fault("doubled", f"the document of {thing.path} made", answer)

    def judge(self, client, thing, body):
        if thing.shown is None:
            shown = self.stable(client, body)
            self.judge_first(client, thing, body)
            # A kill during the first look leaves the thing as one that was not looked at.
            thing.shown = shown
        super().judge(client, thing, body)

    def judge_first(self, client, thing, body):
        """Compares what is shown of a new thing with what was sent."""


class Recordings(Documents):
    name, path = "recordings", "/v1/datasets"

    def draw_document(self):
        rows = [line.split(",") for line in carriage(self.random.randint(60, 150)).splitlines()]
        for row in rows[1:]:
            row[2] = repr(float(row[2]) + round(self.random.random(), 6))
        text = "\n".join(",".join(row) for row in rows) + "\n"
        facts = {"rows": rows[1:], "samples": None}
        return f"/v1/datasets?name=recording-{self.number}", text, {"content-type": "text/csv"}, facts

    def name_of(self, answer):
        return answer["id"]

    def samples(self, client, thing):
        self.call(client, "GET", f"{thing.path}/samples", headers={"accept": "text/csv"}, accept=(200,))
        return client.text

    def judge_first(self, client, thing, body):
        text = client.text
        rows = [line.split(",") for line in self.samples(client, thing).decode().splitlines()[1:]]
        thing.samples = digest(client.text)
        shown, sent = ([[float(cell) for cell in row] for row in part] for part in (rows, thing.rows))
        # Times stand on a grid, whose products are rounded in another way than the text that was sent.
        if ([row[1:] for row in shown] != [row[1:] for row in sent]
                or any(abs(low[0] - high[0]) > 1e-9 for low, high in zip(shown, sent))):
            self.fault("changed", f"{thing.path} has other samples than were sent", client.text)
        client.text = text

    def judge(self, client, thing, body):
        super().judge(client, thing, body)
        if digest(self.samples(client, thing)) != thing.samples:
            self.fault("changed", f"{thing.path} has other samples than before")


class Models(Documents):
    name, path = "models", "/v1/models"

    def draw_document(self):
        document = {
            "name": "stored_lag",
            "inputs": {"u": {"unit": "V"}},
            "parameters": {"time": {"unit": "s", "default": 1 + self.number / 1e5, "lower": 0.1, "upper": 10,
                                    "unknown": True}},
            "states": {"x": {"unit": "V", "derivative": "(u - x)/time", "initial": 0}},
            "outputs": {"y": {"unit": "V", "expression": "x"}}}
        return "/v1/models", document, {}, {"document": document}

    def name_of(self, answer):
        return answer["name"]

    def judge_first(self, client, thing, body):
        if body["document"] != thing.document:
            self.fault("changed", f"{thing.path} is another document than was sent", body["document"])


def rules(stream, field):
    return [{"measurement": "rig", "tags": {"hall": field}, "stream": stream,
             "signals": {"position": {"signal": "position", "unit": "m"}}}]


class Mappings(Kind):
    """Mappings whose rules are put anew and deleted."""

    name = "mappings"
    names = 5

    def __init__(self, plant):
        super().__init__(plant)
        # Rules whose call was cut off, by path.
        self.asked = {}

    def act(self, client):
        path = f"/v1/mappings/mapping-{self.random.randrange(self.names)}"
        draw, thing = self.random.random(), self.things.get(path)
        if thing is None or draw < 0.5:
            self.put(client, path, thing)
        elif draw < 0.7:
            self.look(client, path)
        else:
            self.remove(client, thing)

    def put(self, client, path, thing):
        self.number += 1
        wanted = self.asked[path] = rules(f"mapped-{self.number}", str(self.number))
        self.touch(path)
        status, _ = self.call(client, "PUT", path, {"rules": wanted}, accept=(200, 201))
        if (status == 201) != (thing is None):
            self.fault("contradicted", f"{path}, there: {thing is not None}, was put and answered {status}")
        self.count("made" if status == 201 else "changed")
        self.note(path, wanted)

    def note(self, path, wanted):
        """Notes the rules that a mapping has."""
        self.asked.pop(path, None)
        if path in self.gone_paths:
            self.gone_paths.discard(path)
            self.gone.remove(path)
        self.keep(path, shown=wanted)

    def look(self, client, path):
        status, body = self.show(client, path)
        thing, asked = self.things.get(path), self.asked.pop(path, None)
        if asked is not None and status == 200 and body["rules"] == asked:
            self.note(path, asked)
        elif thing is not None and status == 404:
            self.miss(thing)
        elif thing is not None:
            thing.is_leaving = False
            self.judge(client, thing, body)
        elif status == 200:
            self.fault("contradicted", f"{path} is not there and is shown", body)

    def stable(self, client, body):
        return body["rules"]


class Lines(Kind):
    """Lines of an agent that go to two streams through a mapping, which is removed with both after some requests."""

    name = "requests of agents"
    requests = 12

    def __init__(self, plant):
        super().__init__(plant)
        self.begin_mapping()

    def begin_mapping(self):
        self.number += 1
        name = f"lines-{self.number}"
        self.mapping, self.streams = f"/v1/mappings/{name}", [f"/v1/streams/{name}-{part}" for part in "ab"]
        # Values by instant [ms] that were acknowledged, and those of a request that was cut off.
        self.values, self.cut_values, self.sent, self.leaving = None, None, 0, None
        self.is_leaving = False

    def act(self, client):
        if self.leaving:
            self.leave(client)
        elif self.values is None:
            wanted = [rule for part in "ab" for rule in rules(f"lines-{self.number}-{part}", part)]
            self.call(client, "PUT", self.mapping, {"rules": wanted}, accept=(200, 201))
            self.values = {}
            self.count("mappings made")
        elif self.sent >= self.requests:
            self.leaving = [self.mapping, *self.streams]
        else:
            self.write(client)

    def write(self, client):
        if self.cut_values is None:
            first = (self.sent + 1) * 1000
            self.cut_values = {first + k: round(self.random.random(), 4) for k in range(self.random.randint(1, 4))}
        start_ms = round(START.timestamp() * 1000)
        lines = "".join(f"rig,hall={part} position={value} {(start_ms + ms) * MS_IN_NS}\n"
                        for ms, value in self.cut_values.items() for part in "ab")
        path = "/write?db=" + self.mapping.rsplit("/", 1)[1]
        self.call(client, "POST", path, lines, accept=(204,))
        self.count("made")
        self.values.update(self.cut_values)
        self.cut_values, self.sent = None, self.sent + 1

    def stored(self, client, path):
        status, shown = self.call(client, "GET", path, accept=(200, 404))
        if status == 404 or not shown["samples"]:
            return {}
        self.call(client, "GET", path, headers={"accept": "text/csv"}, accept=(200,))
        first = milliseconds(shown["first"])
        rows = (line.split(",") for line in client.text.decode().splitlines()[1:])
        return {first + round(float(row[0]) * 1000): float(row[1]) for row in rows}

    def check(self, client):
        if self.leaving:
            self.settle_leave(client)
        elif self.values is not None:
            self.judge_values(client)
        super().check(client)

    def judge_values(self, client):
        """A request is in both streams or in none."""
        stored = [self.stored(client, path) for path in self.streams]
        allowed = [self.values] + ([{**self.values, **self.cut_values}] if self.cut_values else [])
        if stored[0] != stored[1] or stored[0] not in allowed:
            lost = any(values.get(ms) != value for values in stored for ms, value in self.values.items())
            self.fault("lost" if lost else "changed", f"{self.streams} have {stored} and had {allowed}")

    def leave(self, client):
        """Deletes the mapping, and then each of the streams."""
        self.is_leaving = True
        self.call(client, "DELETE", self.leaving[0], accept=(204,))
        self.count("mappings deleted" if self.leaving[0] == self.mapping else "streams deleted")
        self.left()

    def left(self):
        self.is_leaving = False
        path = self.leaving.pop(0)
        self.gone.append(path)
        self.gone_paths.add(path)
        self.touch(path)
        if not self.leaving:
            self.begin_mapping()

    def settle_leave(self, client):
        status, _ = self.show(client, self.leaving[0])
        if status == 404:
            if not self.is_leaving:
                self.fault("lost", f"{self.leaving[0]} was not deleted and is not there")
            self.left()
        self.is_leaving = False

    def look(self, client, path):
        super().look(client, path)
        if path.startswith("/v1/mappings/") and path in self.gone_paths and self.random.random() < 0.2:
            line = f"rig,hall=a position=1 {round(START.timestamp() * 1000) * MS_IN_NS}\n"
            self.call(client, "POST", "/write?db=" + path.rsplit("/", 1)[1], line, accept=(404,))
