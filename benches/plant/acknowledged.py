"""What clients of a server that is killed were answered, and whether the server still shows it."""

import collections
import hashlib
import random
import threading

# The ways in which a server breaks what it acknowledged; the last is an answer that no call should have.
FAULTS = ("lost", "doubled", "changed", "contradicted", "unexpected")
# Things of one kind, and removed things of it, that are looked at in each life though no call touched them.
LOOKED_AT = 1
# The longest text of an answer that a line of a fault shows.
LONGEST_SHOWN = 300


class Cut(Exception):
    """A call to which no answer came."""


def digest(text):
    return hashlib.sha256(text).hexdigest()


class Ledger:
    """The acknowledged calls by kind, and the faults that were seen."""

    def __init__(self):
        self.lock = threading.Lock()
        self.calls = collections.Counter()
        self.cut_off = collections.Counter()
        self.faults = collections.Counter()
        self.busy = 0

    def count(self, kind, call):
        with self.lock:
            self.calls[kind, call] += 1

    def count_cut(self, kind):
        with self.lock:
            self.cut_off[kind] += 1

    def count_busy(self):
        with self.lock:
            self.busy += 1

    def fault(self, sort, text):
        with self.lock:
            self.faults[sort] += 1
            print(f"resources: {sort}: {text}", flush=True)

    def line(self):
        """The acknowledged calls as one line, and the faults."""
        kinds = list(dict.fromkeys(kind for kind, _ in self.calls))
        parts = []
        for kind in kinds:
            calls = {call: number for (of, call), number in self.calls.items() if of == kind}
            made = calls.pop("made", 0)
            rest = ", ".join(f"{number} {call}" for call, number in sorted(calls.items()))
            parts.append(f"{made} {kind}" + (f" ({rest})" if rest else ""))
        faults = ", ".join(f"{self.faults[sort]} {sort}" for sort in FAULTS)
        return (f"acknowledged: {', '.join(parts)}; {sum(self.cut_off.values())} calls cut off, {self.busy} answered "
                f"503; {faults}")

    def is_good(self):
        return not sum(self.faults.values())


class Thing:
    """A thing that a server acknowledged: its path, and what is to be shown of it."""

    def __init__(self, path, **facts):
        self.path, self.is_leaving = path, False
        self.__dict__.update(facts)


class Kind:
    """The calls that clients make of one kind of resource, and how the answers are judged after a kill."""

    name = ""

    def __init__(self, plant):
        self.plant, self.ledger = plant, plant.ledger
        self.random = random.Random(f"{plant.seed} {self.name}")
        self.things, self.gone, self.gone_paths = {}, [], set()
        # Paths that calls of the last life touched.
        self.touched = {}
        # A creation that was not answered.
        self.pending = None
        self.number = 0

    def call(self, client, method, path, body=None, headers=None, accept=()):
        """The status and the body of an answer that is among those that may come."""
        status, answer, _ = client.ask(method, path, body, headers)
        if status == 0:
            self.plant.note_silence(f"{method} {path}")
            if method != "GET":
                self.ledger.count_cut(self.name)
            raise Cut
        if status == 503:
            self.ledger.count_busy()
            raise Cut
        if status not in accept:
            self.fault("unexpected", f"{method} {path} was answered {status}", answer)
            raise Cut
        return status, answer

    def fault(self, sort, text, shown=None):
        shown = "" if shown is None else f": {str(shown)[:LONGEST_SHOWN]}"
        self.ledger.fault(sort, f"{self.name}, life {self.plant.life}: {text}{shown}")

    def count(self, call):
        self.ledger.count(self.name, call)

    def touch(self, path):
        self.touched[path] = True

    def settle(self, client):
        """Brings a creation that was cut off to its end; each kind has its way."""

    def check(self, client):
        """Looks at what the calls of the last lives touched, and at a few other things."""
        if self.pending is not None:
            self.settle(client)
        for path in list(self.touched):
            self.look(client, path)
            self.touched.pop(path, None)
        for paths in (list(self.things), self.gone):
            for path in self.random.sample(paths, min(LOOKED_AT, len(paths))):
                self.look(client, path)

    def check_all(self, client):
        """Looks at everything, with calls that nothing cuts off."""
        self.check(client)
        for path in [*self.things, *self.gone]:
            self.look(client, path)

    def show(self, client, path):
        """The status and the body of what a path shows."""
        return self.call(client, "GET", path, accept=(200, 404))

    def look(self, client, path):
        status, body = self.show(client, path)
        thing = self.things.get(path)
        if thing is None:
            if status == 200 and path in self.gone_paths:
                self.fault("contradicted", f"{path} was removed and is shown again", body)
        elif status == 404:
            self.miss(thing)
        else:
            # A removal that was cut off did not happen, and no server is left that could do it.
            thing.is_leaving = False
            self.judge(client, thing, body)

    def miss(self, thing):
        """A thing is not shown: it was lost, or a removal that was cut off had happened."""
        if not thing.is_leaving:
            self.fault("lost", f"{thing.path} was acknowledged and is not there")
        self.forget(thing)

    def judge(self, client, thing, body):
        """Compares what is shown of a thing with what was acknowledged."""
        shown = self.stable(client, body)
        if shown != thing.shown:
            self.fault("changed", f"{thing.path} was {str(thing.shown)[:LONGEST_SHOWN]} and is now", shown)
            thing.shown = shown

    def stable(self, client, body):
        """The part of an answer that never changes."""
        return digest(client.text)

    def keep(self, path, **facts):
        """Notes a thing that was acknowledged."""
        thing = self.things[path] = Thing(path, **facts)
        self.touch(path)
        return thing

    def forget(self, thing):
        """Notes that a thing is gone for good."""
        if self.things.pop(thing.path, None):
            self.gone.append(thing.path)
            self.gone_paths.add(thing.path)

    def remove(self, client, thing):
        thing.is_leaving = True
        self.touch(thing.path)
        self.call(client, "DELETE", thing.path, accept=(204,))
        self.count("deleted")
        self.forget(thing)

    def some(self, fits=lambda thing: True):
        """A thing that fits, drawn at random, or nothing."""
        fitting = [thing for thing in self.things.values() if fits(thing)]
        return self.random.choice(fitting) if fitting else None

    def act(self, client):
        """Makes one call, drawn at random."""
        raise NotImplementedError
