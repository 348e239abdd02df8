"""Historians of the measurement's own that `greybox collect` reads, the collector as a process, and a writer that
knows what the historians hold."""

import atexit
import base64
import collections
import http.client
import json
import math
import os
import random
import shutil
import subprocess
import tempfile
import threading
import time
import urllib.parse
from datetime import datetime, timedelta, timezone

from postgres import HOST, Postgres, free_port

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
# Historians know these secrets; the server makes its token.
POSTGRES_PASSWORD, INFLUX_PASSWORD = "postgres-secret-7f3a91", "influx-secret-52c8de"
ROLE = "collector"
# The collector reads its secrets from these files.
SECRET_FILES = ("postgres.secret", "influx.secret", "token.secret")
# Rows come late, and are rewritten later, by up to this [s].
LATE_S = 1.5
# The writer pauses for so long between two turns [s].
PAUSE_S = 0.02
# Rows are late, rewrite an earlier row, or have a bad quality with these percentages.
LATE_PERCENT, REWRITTEN_PERCENT, BAD_PERCENT = 15, 15, 10
# Codes of quality are those of OPC in the long table. An Ignition history has the codes of Ignition 7 also when a later
# version writes the history.
GOOD, OPC_BAD, IGNITION_BAD = 192, (0, 4, 24), (0, 500, 600)


def iso(instant):
    """An instant in microseconds since 1970 as a text."""
    return (EPOCH + timedelta(microseconds=instant)).isoformat()


def microseconds(text):
    """Microseconds since 1970 of a text such as `2026-11-28T07:00:00.123456Z`."""
    whole, _, fraction = text.removesuffix("Z").partition(".")
    seconds = (datetime.fromisoformat(whole).replace(tzinfo=timezone.utc) - EPOCH) // timedelta(seconds=1)
    return seconds * 10**6 + int(fraction.ljust(6, "0")[:6])


class Session:
    """A connection of psql that is kept."""

    def __init__(self, database):
        command = [os.path.join(database.bin, "psql"), "--no-psqlrc", "--quiet", "--tuples-only", "--no-align",
                   "--set", "ON_ERROR_STOP=1", "--dbname", database.url(user="postgres")]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, statements):
        """Runs statements to their end; the lines that they answer."""
        self.process.stdin.write(f"{statements}\n\\echo =end=\n")
        self.process.stdin.flush()
        lines = []
        while (line := self.process.stdout.readline()) != "=end=\n":
            assert line, "psql ended early"
            lines.append(line.rstrip("\n"))
        return lines

    def close(self):
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def scram_postgres():
    """A PostgreSQL that asks the collector for a password and believes others."""
    database = Postgres(fsync="off")
    rules = os.path.join(database.data, "pg_hba.conf")
    with open(rules) as file:
        text = file.read()
    with open(rules, "w") as file:
        file.write(f"host all {ROLE} {HOST}/32 scram-sha-256\n{text}")
    database.sql(f"set password_encryption = 'scram-sha-256'; create role {ROLE} login password '{POSTGRES_PASSWORD}'")
    database.sql(f"grant pg_read_all_data to {ROLE}")
    database.sql("select pg_reload_conf()")
    return database


class Influx:
    """An InfluxDB 1 that asks for a user and a password, with an empty database `plant`."""

    @staticmethod
    def program():
        return shutil.which("influxd")

    def __init__(self):
        self.folder, self.port = tempfile.mkdtemp(prefix="influx-"), free_port()
        settings = os.path.join(self.folder, "influxdb.conf")
        with open(settings, "w") as file:
            file.write(f"""reporting-enabled = false
bind-address = "{HOST}:{free_port()}"
[meta]
dir = "{self.folder}/meta"
[data]
dir = "{self.folder}/data"
wal-dir = "{self.folder}/wal"
query-log-enabled = false
[monitor]
store-enabled = false
[http]
bind-address = "{HOST}:{self.port}"
auth-enabled = true
log-enabled = false
""")
        self.log = open(os.path.join(self.folder, "log"), "w")
        self.process = subprocess.Popen([self.program(), "-config", settings], stdout=self.log, stderr=self.log)
        atexit.register(self.remove)
        both = base64.b64encode(f"{ROLE}:{INFLUX_PASSWORD}".encode()).decode()
        self.headers, self.connection = {"authorization": f"Basic {both}"}, None
        until = time.monotonic() + 60
        while self.ask("GET", "/ping")[0] != 204:
            assert time.monotonic() < until, "the InfluxDB did not start"
            time.sleep(0.05)
        for query in (f"CREATE USER {ROLE} WITH PASSWORD '{INFLUX_PASSWORD}' WITH ALL PRIVILEGES",
                      "CREATE DATABASE plant"):
            status, text = self.ask("POST", "/query?" + urllib.parse.urlencode({"q": query}))
            assert status == 200, text

    def ask(self, method, path, body=None):
        try:
            if self.connection is None:
                self.connection = http.client.HTTPConnection(HOST, self.port, timeout=60)
            self.connection.request(method, path, body, self.headers)
            answer = self.connection.getresponse()
            return answer.status, answer.read()
        except (OSError, http.client.HTTPException):
            self.connection = None
            return 0, b""

    def write(self, lines):
        status, text = self.ask("POST", "/write?db=plant&precision=u", lines.encode())
        assert status == 204, (status, text)

    def remove(self):
        self.process.kill()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


class Collector:
    """`greybox collect` as a process, with a folder for its file of sources, its cursors and its log."""

    def __init__(self, options, folder, url, token):
        self.program, self.folder, self.url, self.process = options.program, folder, url, None
        self.log = os.path.join(folder, "collector.log")
        for name, secret in zip(SECRET_FILES, (POSTGRES_PASSWORD, INFLUX_PASSWORD, token)):
            with open(os.path.join(folder, name), "w") as file:
                file.write(secret + "\n")
        atexit.register(self.kill)

    def describe(self, sources):
        with open(os.path.join(self.folder, "sources.toml"), "w") as file:
            file.write(f'[server]\nurl = "{self.url}"\ntoken = {{ file = "token.secret" }}\n{sources}')

    def start(self, *settings):
        with open(self.log, "a") as log:
            self.process = subprocess.Popen(
                [self.program, "collect", os.path.join(self.folder, "sources.toml"), *settings],
                stdout=subprocess.DEVNULL, stderr=log)

    def kill(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()

    def lines(self):
        """The lines of the log that are whole; a kill cuts a line off."""
        with open(self.log) as file:
            for line in file:
                try:
                    entry = json.loads(line)
                except ValueError:
                    continue
                yield entry["level"], entry["fields"]

    def rows(self, source):
        """The rows that were read of a source, as the log tells of each pass."""
        return sum(fields["rows"] for _, fields in self.lines() if fields.get("source") == source and "rows" in fields)


def postgres_source(name, database, since, series, kind="postgresql", **settings):
    """A source of a sources file."""
    entries = "".join(f"{key} = {value}\n" for key, value in settings.items())
    return (f'\n[[source]]\nname = "{name}"\nkind = "{kind}"\n'
            f'address = "postgres://{ROLE}@{HOST}:{database.port}/greybox"\n'
            f'password = {{ file = "postgres.secret" }}\nfrom = {iso(since)}\n{entries}{series}')


def influx_source(name, influx, since, series, **settings):
    entries = "".join(f"{key} = {value}\n" for key, value in settings.items())
    return (f'\n[[source]]\nname = "{name}"\nkind = "influxdb"\nurl = "http://{HOST}:{influx.port}"\n'
            f'database = "plant"\nuser = "{ROLE}"\npassword = {{ file = "influx.secret" }}\n'
            f"from = {iso(since)}\n{entries}{series}")


def cell(value):
    """A value as SQL writes it."""
    return "NULL" if value is None else str(value).lower() if isinstance(value, bool) else repr(value)


class Content:
    """Content that a stream is to have: its signals at each instant in microseconds, nothing where a sample is bad or
    missing."""

    def __init__(self, stream, step=1):
        # Instants are whole multiples of the step.
        self.stream, self.step, self.rows, self.recent = stream, step, {}, collections.deque(maxlen=300)
        # Bad samples stand here by their instants and signals.
        self.bad = set()

    def keep(self, instant, **values):
        self.rows.setdefault(instant, {}).update(values)

    def keep_with_quality(self, instant, signal, value, is_good):
        self.keep(instant, **{signal: value if is_good else None})
        (self.bad.discard if is_good else self.bad.add)((instant, signal))

    def choose(self, draw, now):
        """The instant of the next row, and whether an earlier row is rewritten."""
        kind, past = draw.random() * 100, now - int(LATE_S * 1e6)
        if kind < REWRITTEN_PERCENT:
            instants = [instant for instant in self.recent if instant >= past]
            if instants:
                return draw.choice(instants), True
        if kind > 100 - LATE_PERCENT:
            now = draw.randint(past, now)
        instant = now // self.step * self.step
        is_rewritten = instant in self.rows
        self.recent.append(instant)
        return instant, is_rewritten


class Wide(Content):
    """A table of instants with three signals beside each other."""
    TABLE = "create table wide (at timestamptz primary key, pos double precision, force real, valve boolean)"
    SERIES = """[[source.series]]
stream = "wide"
table = "wide"
time = "at"
[source.series.signals]
position = { column = "pos", unit = "mm" }
force = { unit = "kN" }
valve = { interpolation = "hold" }
"""

    def row(self, draw, now):
        instant, is_rewritten = self.choose(draw, now)
        position, force, valve = draw.uniform(-500, 500), draw.randint(-4000, 4000) / 8, draw.random() < 0.5
        # A missing sample changes nothing in a stream, so that no row is rewritten to one.
        force = None if not is_rewritten and draw.random() < 0.1 else force
        self.keep(instant, position=position * 1e-3, force=force and force * 1e3, valve=float(valve))
        return (f"insert into wide values ('{iso(instant)}', {cell(position)}, {cell(force)}, {cell(valve)}) "
                "on conflict (at) do update set pos = excluded.pos, force = excluded.force, valve = excluded.valve;")


class Long(Content):
    """A table with a row for each sample of a tag and its code of quality. A further tag is not collected."""
    TABLE = "create table long (tag text, ts bigint, val double precision, q int, primary key (tag, ts))"
    SIGNALS = {"PT-101": ("pressure", "bar", 1e5), "FT-102": ("flow", "L/min", 1e-3 / 60)}
    SERIES = "".join(f"""[[source.series]]
stream = "long"
table = "public.long"
time = "ts"
time_unit = "ms"
where = {{ tag = "{tag}" }}
quality_scheme = "opc_da"
signals = {{ {signal} = {{ column = "val", unit = "{unit}", quality = "q" }} }}
""" for tag, (signal, unit, _) in SIGNALS.items())

    def row(self, draw, now):
        instant, _ = self.choose(draw, now)
        tag, value = draw.choice((*self.SIGNALS, "XT-103")), draw.uniform(1, 200)
        quality = draw.choice(OPC_BAD) if draw.random() * 100 < BAD_PERCENT else GOOD
        if tag in self.SIGNALS:
            signal, _, factor = self.SIGNALS[tag]
            self.keep_with_quality(instant, signal, value * factor, quality == GOOD)
        return (f"insert into long values ('{tag}', {instant // 1000}, {cell(value)}, {quality}) "
                "on conflict (tag, ts) do update set val = excluded.val, q = excluded.q;")


class Ignition(Content):
    """The history of an Ignition gateway with two partitions; the first tag has another number in the second."""
    SERIES = """[[source.series]]
stream = "ignition"
tag = "Press/Pressure"
signal = "pressure"
unit = "bar"
[[source.series]]
stream = "ignition"
tag = "press/count"
signal = "count"
"""

    def __init__(self, begin, bound):
        super().__init__("ignition", 1000)
        # The partitions part at this instant.
        self.bound = bound // 1000 * 1000
        columns = ("tagid int, intvalue bigint, floatvalue double precision, stringvalue text, datevalue timestamp, "
                   "dataintegrity int, t_stamp bigint, primary key (tagid, t_stamp)")
        ends = (begin // 1000 - 10**9, self.bound // 1000, begin // 1000 + 10**9)
        self.TABLE = f"""
create table sqlth_te (id int, tagpath text, scid int, datatype int, querymode int, created bigint, retired bigint);
create table sqlth_partitions (pname text, drvid int, start_time bigint, end_time bigint, blocksize int, flags int);
insert into sqlth_te values (1, 'press/pressure', 1, 1, 0, 0, {ends[1]}),
    (7, 'press/pressure', 1, 1, 0, {ends[1]}, null), (2, 'press/count', 1, 0, 0, 0, null);
insert into sqlth_partitions values ('sqlt_data_1_1', 1, {ends[0]}, {ends[1]}, 0, 0),
    ('sqlt_data_1_2', 1, {ends[1]}, {ends[2]}, 0, 0);
create table sqlt_data_1_1 ({columns}); create table sqlt_data_1_2 ({columns})"""

    def row(self, draw, now):
        instant, _ = self.choose(draw, now)
        part = 1 if instant < self.bound else 2
        quality = draw.choice(IGNITION_BAD) if draw.random() * 100 < BAD_PERCENT else GOOD
        if draw.random() < 0.5:
            number, real, whole = (1, 7)[part - 1], draw.uniform(1, 200), None
            self.keep_with_quality(instant, "pressure", real * 1e5, quality == GOOD)
        else:
            number, real, whole = 2, None, draw.randint(0, 10**9)
            self.keep_with_quality(instant, "count", float(whole), quality == GOOD)
        return (f"insert into sqlt_data_1_{part} values ({number}, {cell(whole)}, {cell(real)}, null, null, "
                f"{quality}, {instant // 1000}) on conflict (tagid, t_stamp) do update set "
                "intvalue = excluded.intvalue, floatvalue = excluded.floatvalue, "
                "dataintegrity = excluded.dataintegrity;")


class Measurement(Content):
    """A measurement of an InfluxDB with a tag and two fields. Points of another value of the tag are not collected."""
    SERIES = """[[source.series]]
stream = "influx"
measurement = "press"
where = { line = "a" }
[source.series.signals]
position = { unit = "mm" }
temperature = { unit = "°C" }
"""

    def row(self, draw, now):
        instant, is_rewritten = self.choose(draw, now)
        position, temperature = draw.uniform(-500, 500), draw.uniform(10, 90)
        fields = f"position={position!r}"
        if is_rewritten or draw.random() > 0.1:
            fields += f",temperature={temperature!r}"
            self.keep(instant, temperature=temperature + 273.15)
        self.keep(instant, position=position * 1e-3)
        return f"press,line=a {fields} {instant}\npress,line=b position=1 {instant}\n"


class Writer(threading.Thread):
    """Writes rows with instants near now into all historians, and keeps what they hold."""

    def __init__(self, database, influx, seed):
        super().__init__(daemon=True)
        now = time.time_ns() // 1000
        self.tables = [Wide("wide"), Long("long", 1000), Ignition(now, now + 15 * 10**6)]
        self.measurement = Measurement("influx") if influx else None
        self.database, self.influx, self.draw = database, influx, random.Random(seed)
        # The latest row came so late; the failure is an error that ended the writer.
        self.latest_s, self.failure, self.is_over = 0.0, None, threading.Event()
        for table in self.tables:
            database.sql(table.TABLE)

    def contents(self):
        return [*self.tables, *([self.measurement] if self.measurement else [])]

    def run(self):
        session = Session(self.database)
        try:
            while not self.is_over.wait(PAUSE_S):
                now = time.time_ns() // 1000
                session.run("".join(table.row(self.draw, now) for table in self.tables))
                if self.measurement:
                    self.influx.write(self.measurement.row(self.draw, now))
                self.latest_s = max(self.latest_s, LATE_S + (time.time_ns() // 1000 - now) / 1e6)
        except Exception as error:
            self.failure = error
        session.close()

    def end(self):
        self.is_over.set()
        self.join()
        assert self.failure is None, self.failure


def samples_of(client, stream):
    """The instants of a stream, each with its signals and their values; nothing where there is no such stream."""
    status, shown, _ = client.ask("GET", f"/v1/streams/{stream}")
    if status != 200:
        return
    first = microseconds(shown["first"])
    status, text, _ = client.ask("GET", f"/v1/streams/{stream}", headers={"accept": "text/csv"})
    assert status == 200, text
    titles, *lines = text.decode().splitlines()
    signals = [title.split(" [")[0] for title in titles.split(",")[1:]]
    for line in lines:
        seconds, *cells = line.split(",")
        values = [float(text) if text else None for text in cells]
        yield first + round(float(seconds) * 1e6), list(zip(signals, values))


def instants_of(client, stream):
    return [instant for instant, _ in samples_of(client, stream)]


class Difference:
    """How a stream differs from what a source holds."""

    def __init__(self):
        self.lost = self.doubled = self.changed = self.samples = self.bad = 0
        # Streams that differ stand here.
        self.streams = []

    def is_none(self):
        return self.count() == 0

    def __str__(self):
        bad = f" and {self.bad} bad ones" if self.bad else ""
        streams = f" in {', '.join(self.streams)}" if self.streams else ""
        return f"{self.samples} samples{bad}: {self.lost} lost, {self.doubled} doubled, {self.changed} changed{streams}"

    def count(self):
        return self.lost + self.doubled + self.changed

    def add(self, client, content):
        """Compares all samples of a stream."""
        before = self.count()
        self.compare(client, content)
        if content.bad and self.count() == before:
            self.compare_bad(client, content)
        if self.count() > before:
            self.streams.append(content.stream)

    def compare(self, client, content):
        self.samples += sum(value is not None for values in content.rows.values() for value in values.values())
        seen = set()
        for instant, samples in samples_of(client, content.stream):
            values = content.rows.get(instant)
            if values is None or instant in seen:
                self.doubled += 1
                continue
            seen.add(instant)
            for signal, value in samples:
                expected = values.get(signal)
                if expected is None or value is None:
                    self.lost += expected is not None
                    self.changed += value is not None
                elif not math.isclose(value, expected, rel_tol=1e-12, abs_tol=1e-15):
                    self.changed += 1
        # An instant of which all samples are bad is to be there too.
        self.lost += len(content.rows.keys() - seen)

    def compare_bad(self, client, content):
        """Compares how many samples of each signal are bad, which a recording that is cut out of the stream says."""
        part = {"from": iso(min(content.rows)), "to": iso(max(content.rows) + 1)}
        status, recording, _ = client.ask("POST", f"/v1/streams/{content.stream}/recordings", part)
        assert status in (200, 201), recording
        counts = {signal["name"]: signal["quality"]["bad"] for signal in recording["signals"] if signal["quality"]}
        expected = collections.Counter(signal for _, signal in content.bad)
        self.bad += sum(expected.values())
        self.changed += sum(abs(expected[name] - counts.get(name, 0)) for name in expected.keys() | counts.keys())
