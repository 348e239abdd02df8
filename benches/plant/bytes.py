"""One byte of a stored value is changed below the server: whether that is found, has no effect, or is served."""

import collections
import contextlib
import os
import random
import subprocess
import tempfile
import threading
import time

import postgres
from bytes_changes import Base, File, columns_of, draw
from bytes_plant import SETTINGS, Plant, job
from bytes_questions import DAMAGED, Questions, TextClient
from server import Server

TOGETHER = 20
# A server that says nothing within this time after its start is ended [s].
LONGEST_START_S = 20
LONGEST_CHECK_S = 60
# Work that has not ended within the first time is done again; after the second it is taken for work without an end [s].
LONGEST_WORK_S, LONGEST_WORK_AGAIN_S = 15, 45
PROGRESS_EVERY = 500
# The token by which the measurement asks has to stay what it is.
OF_THE_DRIVER = {"tokens": lambda key: key.get("id") == 1}
# How `greybox check` calls the rows of each table.
WORDS = {
    "jobs": ("specification", "state"), "datasets": ("description", "size"), "dataset_chunks": "part of the samples",
    "stream_blocks": "block", "stream_extremes": "list of extremes", "checkpoints": "checkpoint", "results": "result",
    "events": "event", "generations": "generation", "candidate_records": "list of candidates",
    "candidates": "generation of candidates", "monitors": ("state", "progress"),
    "monitor_windows": ("window", "job and recording"), "monitor_alarms": "alarm", "monitor_events": "event",
    "models": ("model", "source"), "shared_parts": "part", "tokens": ("token", "state"), "job_labels": "label",
    "job_datasets": "reference to a recording", "comparisons": "comparison", "comparison_jobs": "run",
    "idempotency": "key", "signal_lists": "list of signals", "stream_batches": "answer", "streams": "stream",
    "mappings": "mapping", "unmapped_series": "series", "omf_definitions": "definition",
    "dataset_versions": "version of a recording", "layouts": "layout", "sources": "source", "stream_marks": "marks of a stream", "sessions": "session", "project_days": "time at work",
    "webhooks": "webhook", "deliveries": "delivery", "nodes": "life of a server",
}
# What the check says of a row of other tables.
SENTENCES = {
    "audit": "entry {} of the audit log", "job_bytes": "{} keeps another number of bytes",
    "stored_bytes": "the project {} keeps another number of bytes",
}
FOUND = ("by check", "at start", "by the answer")
FAULTS = ("WRONG", "REFUSED", "FAULT")


class Trial:
    """The answers of a server on a database with some changes, beside those on the sound database."""

    def __init__(self, bench, changes, is_running, limit=LONGEST_WORK_S):
        self.bench, self.is_running, self.has_started, self.has_died = bench, is_running, True, False
        self.answers, self.changes, self.limit = {}, changes, limit
        bench.database.restore()
        self.server = Server(bench.options, bench.folder, *SETTINGS, url=bench.database.url)
        if is_running:
            self.start()
            bench.questions.ask_all(self.client())
        self.changes = bench.database.put(changes, is_running) if changes else []
        self.status, self.findings = self.check()
        if not is_running:
            self.has_started = self.start()
        if self.has_started:
            self.ask()
            self.has_died = self.server.process.poll() is not None
            self.server.kill()
            self.server.process = None

    def start(self):
        timer = threading.Timer(LONGEST_START_S, lambda: self.server.cut())
        timer.start()
        has_started = self.server.start()
        timer.cancel()
        return has_started

    def client(self):
        return TextClient(self.server, self.bench.plant.token)

    def check(self):
        done = subprocess.run([self.server.program, "check", "--database", self.server.url], capture_output=True,
                              text=True, errors="replace", timeout=LONGEST_CHECK_S)
        return done.returncode, done.stdout + done.stderr

    def ask(self):
        client = self.client()
        self.answers = self.bench.questions.ask_all(client)
        self.answers.update(self.bench.questions.work(client, self.limit))
        client.close()

    def is_named(self, change):
        """Whether the check names the row of a change."""
        key = " ".join(change.key_after())
        if change.table in SENTENCES:
            return SENTENCES[change.table].format(key) in self.findings
        if change.table == "tokens":
            # Its seal has the digest as the key.
            key = self.bench.value(change, "digest")
        words = WORDS.get(change.table, ())
        return any(f"the stored {word} of {key} does not read back" in self.findings
                   for word in ((words,) if isinstance(words, str) else words))

    def differences(self):
        """The answers that are not those of the sound database: by how they differ."""
        differing = collections.defaultdict(list)
        for question, (status, content) in self.answers.items():
            sound_status, sound = self.bench.sound[question]
            if (status, content) == (sound_status, sound):
                continue
            if (status >= 500 or status == 200) and any(words in content for words in DAMAGED):
                differing["by the answer"].append(question)
            elif status in (0, 500):
                differing["FAULT"].append(question)
            elif status >= 400 > sound_status or status in (408, 503):
                differing["REFUSED"].append(question)
            else:
                differing["WRONG"].append(question)
        if self.has_died:
            differing["FAULT"].append("the server has died")
        return differing

    def outcome(self):
        """What comes of the one change of this trial."""
        differing = self.differences()
        if differing["FAULT"]:
            return "FAULT", differing
        if self.status:
            return "by check", differing
        if not self.has_started:
            return "at start", differing
        return next((kind for kind in ("WRONG", "by the answer", "REFUSED") if differing[kind]), "without effect"), \
            differing


class Bench:
    """The trials on one of the databases."""

    def __init__(self, options, folder, plant, database):
        self.options, self.folder, self.plant, self.database = options, folder, plant, database
        self.counts, self.columns = collections.Counter(), collections.defaultdict(collections.Counter)
        self.served, self.examples, self.sound = {}, collections.defaultdict(list), {}
        # Each column is tried once before columns are drawn.
        self.untried = columns_of(database)
        random.shuffle(self.untried)
        self.questions = self.questions_of_the_sound()
        self.sound = Trial(self, [], False, LONGEST_WORK_AGAIN_S).answers
        for is_running in (False, True):
            again = Trial(self, [], is_running, LONGEST_WORK_AGAIN_S)
            assert not again.status and again.has_started, again.findings
            differing = again.differences()
            assert not any(differing.values()), self.describe(again, differing)

    def questions_of_the_sound(self):
        self.database.restore()
        server = Server(self.options, self.folder, *SETTINGS, url=self.database.url)
        assert server.start(), "a server did not start on the sound database"
        questions = Questions(self.plant, server.client(self.plant.token))
        server.kill()
        return questions

    def run(self, count):
        waiting = {True: [], False: []}
        told = 0
        while (done := sum(self.counts.values())) < count:
            if done // PROGRESS_EVERY > told:
                told = done // PROGRESS_EVERY
                print(f"bytes: {done} of {count} in {self.database.name}: {self.figures()}", flush=True)
            change = self.draw()
            seen = self.columns[change.table, change.column]
            # A column is tried alone once before its changes are tried together with others.
            if not seen or any(seen[fault] for fault in FAULTS):
                self.try_alone(change)
                continue
            # Rows that the check names hide nothing behind the answers that they make fail.
            together = waiting[seen["by check"] > 0]
            together.append(change)
            if len(together) == min(TOGETHER, count - done):
                self.try_together(list(together))
                together.clear()
        self.database.remove()

    def draw(self):
        while True:
            change = draw(self.database, self.untried.pop() if self.untried else None)
            if not OF_THE_DRIVER.get(change.table, lambda key: False)(change.key):
                return change

    def value(self, change, column):
        """The text in a column of a changed row, after the change."""
        if change.column == column:
            return change.after.decode(errors="replace")
        _, rows = self.database.tables[change.table]
        row = next(row for row in rows if all(row[name][1] == value for name, value in change.key.items()))
        return row[column][1].decode(errors="replace")

    def count(self, change, outcome):
        self.counts[outcome] += 1
        self.columns[change.table, change.column][outcome] += 1

    def is_running(self):
        """Every third trial changes the database while a server runs that has read everything."""
        return sum(self.counts.values()) % 3 == 2

    def try_together(self, changes):
        rows = {}
        for change in changes:
            rows.setdefault((change.table, tuple(change.key.values())), change)
        trial = Trial(self, list(rows.values()), self.is_running())
        differing = trial.differences()
        named = [change for change in trial.changes if trial.is_named(change)]
        unexplained = not trial.has_started or differing["FAULT"] or len(named) < len(trial.changes) and (
            trial.status or any(differing.values()))
        for change in trial.changes:
            if differing["FAULT"] or unexplained and change not in named:
                self.try_alone(change, trial.is_running)
            else:
                self.count(change, "by check" if change in named else "without effect")

    def try_alone(self, change, is_running=None):
        change.is_in_the_file = False
        is_running = self.is_running() if is_running is None else is_running
        trial = Trial(self, [change], is_running)
        if not trial.changes:
            return
        if not trial.status and any(status == 408 for status, _ in trial.answers.values()):
            trial = Trial(self, [change], is_running, LONGEST_WORK_AGAIN_S)
        outcome, differing = trial.outcome()
        self.count(change, outcome)
        column = change.table, change.column
        if outcome in FAULTS:
            self.examples[column].append((outcome, change, differing))
            print(f"bytes: {outcome} in {self.database.name}{' at work' if trial.is_running else ''}: {change}; "
                  f"{self.describe(trial, differing)}", flush=True)
        elif outcome == "by check" and differing["WRONG"]:
            self.served.setdefault(column, (change, differing["WRONG"], self.describe(trial, differing)))

    def describe(self, trial, differing, at_most=3):
        """Some of the answers that differ, each beside the sound answer."""
        parts = []
        for kind in FAULTS:
            for question in differing[kind][:at_most]:
                status, content = trial.answers.get(question, (0, ""))
                sound_status, sound = self.sound.get(question, (0, ""))
                before, after = first_difference(sound, content)
                parts.append(f"{kind} {question}: {sound_status} {before} -> {status} {after}")
            if len(differing[kind]) > at_most:
                parts.append(f"and {len(differing[kind]) - at_most} more")
        return "; ".join(parts)

    def figures(self):
        return ", ".join(f"{count} {outcome}" for outcome, count in sorted(self.counts.items()))


def first_difference(before, after, width=90):
    """Two texts around the place of their first difference."""
    place = len(os.path.commonprefix([before, after]))
    start = max(0, place - 30)
    return repr(before[start:start + width]), repr(after[start:start + width])


def benches(options, folder, stack):
    """A bench for each of the two databases, with the same content."""
    plant = Plant(options, folder)
    yield Bench(options, folder, plant, File(plant.server.path, folder))
    if not postgres.programs():
        print("bytes: no PostgreSQL is installed here: the changes are made in SQLite alone", flush=True)
        return
    server = postgres.Postgres(fsync="off", full_page_writes="off", autovacuum="off")
    stack.callback(server.remove)
    copied = subprocess.run([options.program, "database", "copy", "--from", f"sqlite://{plant.server.path}",
                             "--to", server.url()], capture_output=True, text=True)
    assert copied.returncode == 0, copied.stderr
    # The queue keeps a row of each job that was worked here.
    node = Server(options, folder, *SETTINGS, url=server.url())
    assert node.start(), "a server did not start on PostgreSQL"
    client = node.client(plant.token)
    client.ended(client.submit(job(plant.small)))
    time.sleep(0.5)
    client.close()
    node.terminate()
    yield Bench(options, folder, plant, Base(server))


def bytes_(options):
    """Bytes of stored values that changed below the server, in SQLite and in PostgreSQL."""
    count, done, began = options.count or 10_000, [], time.monotonic()
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        both = benches(options, folder, stack)
        share = count // 2 if postgres.programs() else count
        for bench in both:
            bench.run(share)
            done.append(bench)
            summarize(bench)
    totals = sum((bench.counts for bench in done), collections.Counter())
    tables = {table for bench in done for table, _ in bench.columns}
    parts = ", ".join(f"{sum(bench.counts.values())} in {bench.database.name}" for bench in done)
    found = ", ".join(f"{totals[kind]} found {kind}" for kind in FOUND)
    print(f"bytes: {sum(totals.values())} changed ({parts}) over {len(tables)} tables: {found}, "
          f"{totals['without effect']} without effect, {totals['WRONG']} WRONG, {totals['REFUSED']} REFUSED though "
          f"sound, {totals['FAULT']} FAULTS; {time.monotonic() - began:.0f} s", flush=True)
    return not any(totals[fault] for fault in FAULTS)


def summarize(bench):
    """The columns with faults, and those whose damage the check names while answers are made from them."""
    print(f"bytes: {bench.database.name}: {bench.figures()}")
    empty = [name for name, (_, rows) in bench.database.tables.items() if not rows]
    print(f"bytes: {bench.database.name}: tables without rows: {', '.join(empty) or 'none'}")
    for (table, column), outcomes in sorted(bench.columns.items()):
        if any(outcomes[fault] for fault in FAULTS):
            text = ", ".join(f"{number} {outcome}" for outcome, number in outcomes.items())
            print(f"bytes: {bench.database.name} column {table}.{column}: {text}")
    for (table, column), (change, _, description) in sorted(bench.served.items()):
        print(f"bytes: {bench.database.name} {table}.{column} is found by the check and served: {change}; "
              f"{description}", flush=True)
