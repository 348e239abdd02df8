"""Samples that `greybox collect` brings from historians into streams are compared with the historians: while the
collector and the server are killed, a historian is away, and rows come late or ahead of the clock. Secrets are looked
for wherever the collector and the server write."""

import base64
import os
import random
import shutil
import tempfile
import time

from collect_sources import (INFLUX_PASSWORD, POSTGRES_PASSWORD, ROLE, SECRET_FILES, Collector, Content, Difference,
                             Influx, Session, Writer, cell, influx_source, instants_of, iso, postgres_source,
                             scram_postgres)
from postgres import Way, free_port, programs
from server import Server

SEED = 20261128
# The time between two kills lies between these bounds [s].
KILLED_AFTER_S = 0.02, 0.4
# The last rows may take so long to their streams [s].
PATIENCE_S = 90
# A source is away for so long [s].
DAY_S = 86_400
# Rows may come so late, as the sources file says; a source takes no less [s].
LATE_S = 60
# Late rows and rows ahead are rows of a source that writes so many a second.
RATE = 10
# Each row of a source may be read so often, on average over all rows.
MOST_READ = 3
# A wrong clock of a source is ahead by as much [s]: farther, and less far, than the collector reads.
FAR_AHEAD_S, LITTLE_AHEAD_S = 600, 20


class Plant:
    """A server that asks for tokens, historians that ask for passwords, and a collector between them."""

    def __init__(self, options, name):
        self.folder = tempfile.mkdtemp(prefix=f"collect-{name}-")
        self.database = scram_postgres()
        self.server = Server(options, self.folder, "--requests-per-second", "100000", database="streams.db")
        self.server.errors = open(os.path.join(self.folder, "server.log"), "w")
        self.reader, self.token = self.server.token("reader", "admin"), self.server.token("collector")
        self.start_server()
        self.server.listen = f"{self.server.address[0]}:{self.server.address[1]}"
        status, _, _ = self.server.client().ask("GET", "/v1/streams")
        assert status == 401, f"the server asks for no token: {status}"
        self.collector = Collector(options, self.folder, f"http://{self.server.listen}", self.token)

    def start_server(self):
        until = time.monotonic() + 30
        while not self.server.start():
            assert time.monotonic() < until, "the server did not start"
            time.sleep(0.05)

    def client(self):
        return self.server.client(self.reader)

    def difference(self, contents):
        difference, client = Difference(), self.client()
        for content in contents:
            difference.add(client, content)
        client.close()
        return difference

    def catch_up(self, contents, patience=PATIENCE_S):
        """Waits until the streams hold what the sources hold, or for so long: the last difference, and how long."""
        began, client = time.monotonic(), self.client()
        while True:
            counts = [(client.ask("GET", f"/v1/streams/{content.stream}")[1] or {}).get("samples", 0)
                      for content in contents]
            is_over = time.monotonic() - began > patience
            if is_over or counts == [len(content.rows) for content in contents]:
                difference = self.difference(contents)
                if is_over or difference.is_none():
                    client.close()
                    return difference, time.monotonic() - began
                time.sleep(0.5)
            time.sleep(0.1)

    def exposures(self):
        """The places outside the files of secrets where a secret stands, and how many places were searched."""
        both = base64.b64encode(f"{ROLE}:{INFLUX_PASSWORD}".encode())
        secrets = (POSTGRES_PASSWORD.encode(), INFLUX_PASSWORD.encode(), both, self.token.encode())
        files = [os.path.join(self.folder, name) for name in os.listdir(self.folder)]
        processes = [f"/proc/{self.collector.process.pid}/{name}" for name in ("cmdline", "environ")
                     if self.collector.process.poll() is None]
        exposed = []
        for place in files + processes:
            with open(place, "rb") as file:
                text = file.read()
            is_exposed = any(secret in text for secret in secrets)
            if place.endswith(".secret"):
                assert is_exposed, f"the search finds no secret in {place}"
            elif is_exposed:
                exposed.append(place)
        return exposed, len(files + processes) - len(SECRET_FILES)

    def close(self, is_good):
        """Ends all processes; the folder stays after a fault."""
        self.collector.kill()
        if self.server.process.poll() is None:
            self.server.terminate()
        self.database.remove()
        if is_good:
            shutil.rmtree(self.folder)
        else:
            print(f"collect: the sources file, the log and the database stay in {self.folder}", flush=True)


def killed(options):
    """Kills the collector or the server at random moments while rows are written, come late and are rewritten."""
    count, draw, kills = options.count or 100, random.Random(SEED), {"collector": 0, "server": 0}
    plant, influx = Plant(options, "killed"), None
    if Influx.program():
        influx = Influx()
    else:
        print("collect: influxd is not installed; the InfluxDB is left out", flush=True)
    writer = Writer(plant.database, influx, SEED)
    since = time.time_ns() // 1000 - 10 * 10**6
    settings = {"every_s": 0.3, "overlap_s": 2, "late_s": LATE_S}
    sources = [postgres_source(name, plant.database, since, table.SERIES, page_rows=rows, **settings,
                               kind="ignition" if name == "ignition" else "postgresql")
               for name, table, rows in zip(("wide", "long", "ignition"), writer.tables, (40, 40, 500))]
    if influx:
        sources.append(influx_source("influx", influx, since, writer.measurement.SERIES, page_rows=200, **settings))
    plant.collector.describe("".join(sources))
    began = time.monotonic()
    writer.start()
    plant.collector.start("--log", "debug")
    for _ in range(count):
        time.sleep(draw.uniform(*KILLED_AFTER_S))
        victim = draw.choice(("collector", "server"))
        kills[victim] += 1
        if victim == "collector":
            plant.collector.kill()
            plant.collector.start("--log", "debug")
        else:
            plant.server.kill()
            plant.start_server()
        assert writer.failure is None, writer.failure
    writer.end()
    lasted = time.monotonic() - began
    plant.collector.kill()
    exposed, places = plant.exposures()
    plant.collector.start("--log", "trace")
    difference, took = plant.catch_up(writer.contents())
    more, more_places = plant.exposures()
    passes = sum("rows" in fields for _, fields in plant.collector.lines())
    is_good = difference.is_none() and not exposed and not more
    plant.close(is_good)
    if influx:
        influx.remove()
    print(f"collect: {kills['collector']} kills of the collector and {kills['server']} of the server in {lasted:.0f} "
          f"s, rows up to {writer.latest_s:.2f} s late; {difference}; caught up {took:.1f} s after; {passes} passes "
          f"brought samples; secrets in {len(exposed) + len(more)} of {places + more_places} places {exposed + more}",
          flush=True)
    return is_good


class Tank(Content):
    """A table of one signal, written in order by the measurements of a source that is away, late or ahead."""

    def __init__(self, name, database):
        super().__init__(name)
        self.database, self.draw = database, random.Random(SEED)
        database.sql(f"create table {name} (at timestamptz primary key, level double precision)")

    def series(self):
        return (f'[[source.series]]\nstream = "{self.stream}"\ntable = "{self.stream}"\ntime = "at"\n'
                'signals = { level = { unit = "mm" } }\n')

    def statement(self, instants, is_kept=True):
        """A statement that writes rows at instants, and again where there are rows."""
        rows = []
        for instant in instants:
            level = self.draw.uniform(0, 3000)
            rows.append(f"('{iso(instant)}', {cell(level)})")
            if is_kept:
                self.keep(instant, level=level * 1e-3)
        return (f"insert into {self.stream} values {', '.join(rows)} "
                "on conflict (at) do update set level = excluded.level;")


def now_us():
    return time.time_ns() // 1000


def write(session, tank, instants, is_kept=True):
    instants = list(instants)
    for begin in range(0, len(instants), 5000):
        session.run(tank.statement(instants[begin:begin + 5000], is_kept))


def away(options):
    """The source is stopped for a day, whose rows are all there when it comes back; the collector is killed then."""
    plant = Plant(options, "away")
    tank, now = Tank("tank", plant.database), now_us()
    day_ago = now - DAY_S * 10**6
    session = Session(plant.database)
    write(session, tank, range(day_ago - 3600 * 10**6, day_ago, 10**6))
    session.close()
    plant.collector.describe(postgres_source("tank", plant.database, day_ago - 7200 * 10**6, tank.series(), every_s=0.3,
                                             overlap_s=2, late_s=LATE_S, page_rows=5000))
    plant.collector.start()
    before, _ = plant.catch_up([tank])
    database, port = plant.database, plant.database.port
    database.stop()
    # The collector meets that the source is away before the rows of the day are written at another port.
    until = time.monotonic() + 30
    while not any(level == "WARN" for level, _ in plant.collector.lines()):
        assert time.monotonic() < until, "the collector does not say that the source is away"
        time.sleep(0.1)
    database.port = free_port()
    database.start()
    session = Session(database)
    write(session, tank, range(day_ago, now_us(), 10**6))
    session.close()
    database.stop()
    database.port = port
    read_before = plant.collector.rows("tank")
    began = time.monotonic()
    database.start()
    until = began + 90
    while plant.collector.rows("tank") == read_before and tank_samples(plant, tank) == 3600:
        assert time.monotonic() < until, "the collector does not come back to the source"
        time.sleep(0.02)
    back = time.monotonic() - began
    plant.collector.kill()
    plant.collector.start()
    after, took = plant.catch_up([tank])
    is_good = before.is_none() and after.is_none()
    plant.close(is_good)
    print(f"collect_away: {after}; a source that was away for a day is read again {back:.1f} s after it came back, and "
          f"all is there {took:.1f} s after a kill of the collector in the middle", flush=True)
    return is_good


def tank_samples(plant, tank):
    return (plant.client().ask("GET", f"/v1/streams/{tank.stream}")[1] or {}).get("samples", 0)


class Late:
    """Tables of a source with rows that come late, ahead of the clock, at the instant from which the source is read,
    and behind a connection that is lost. In the place of eight hours and of three days there is the least lateness
    that a source takes."""

    def __init__(self, options):
        self.plant, self.begin, self.step = Plant(options, "late"), now_us() - 10 * LATE_S * 10**6, 10**6 // RATE
        self.session, self.way = Session(self.plant.database), Way(self.plant.database.port)
        names = ("late", "ahead", "little", "oldest", "deaf")
        self.late, self.ahead, self.little, self.oldest, self.deaf = (Tank(name, self.plant.database) for name in names)
        settings = {"every_s": 1, "overlap_s": 1, "late_s": LATE_S}
        sources = [postgres_source(table.stream, self.way if table is self.deaf else self.plant.database, self.begin,
                                   table.series(), **settings)
                   for table in (self.late, self.ahead, self.little, self.oldest, self.deaf)]
        self.plant.collector.describe("".join(sources))

    def write(self, table, instants, is_kept=True):
        write(self.session, table, instants, is_kept)

    def difference(self, *tables, patience=30):
        return self.plant.catch_up(tables, patience)

    def follow(self, until):
        """Writes rows at the instants of the clock."""
        while time.monotonic() < until:
            for table in (self.late, self.ahead, self.little):
                self.write(table, [now_us()])
            time.sleep(1 / RATE)

    def rewrite(self):
        """Writes rows as late as the source takes them, between those that are there, and rewrites three stretches
        for three days; how many rows are late and how many are rewritten."""
        past = now_us() - LATE_S * 10**6
        self.write(self.late, [past + 17 + place * self.step for place in range(3 * RATE)])
        past = now_us() - LATE_S * 10**6
        third, count = LATE_S * 10**6 // 3, 0
        for day in range(3):
            bounds = past + day * third, past + (day + 1) * third
            rewritten = [instant for instant in self.late.rows if bounds[0] <= instant < bounds[1]]
            self.write(self.late, rewritten)
            count += len(rewritten)
        return 3 * RATE, count


def late(options):
    """Rows come late, ahead of the clock and behind a connection that is lost."""
    study = Late(options)
    plant, tank, ahead, little = study.plant, study.late, study.ahead, study.little
    study.write(tank, range(study.begin + study.step, now_us(), study.step))
    study.write(study.oldest, [study.begin])
    study.write(study.deaf, [now_us()])
    plant.collector.start()
    first, _ = study.difference(tank, study.deaf)
    at_from, _ = study.difference(study.oldest, patience=3)
    study.way.lose()
    study.write(study.deaf, [now_us()])
    lost_at = time.monotonic()
    wrong = [now_us() + FAR_AHEAD_S * 10**6 + place * study.step for place in range(5 * RATE)]
    study.write(ahead, wrong, is_kept=False)
    study.write(little, [now_us() + LITTLE_AHEAD_S * 10**6 + place * study.step for place in range(5 * RATE)])
    stored_ahead, _ = study.difference(little)
    study.follow(time.monotonic() + 5)
    late_rows, rewritten = study.rewrite()
    began = time.monotonic()
    study.follow(began + 2)
    # Rows with right instants come although rows ahead of the clock were there before.
    right, lag = study.difference(ahead, little)
    study.follow(began + 2 * LATE_S + 5)
    last, _ = study.difference(tank, ahead, little)
    deaf, _ = study.difference(study.deaf)
    deaf_s = time.monotonic() - lost_at
    study.session.close()
    stored = set(instants_of(plant.client(), ahead.stream)) & set(wrong)
    read, rows, history = plant.collector.rows("late"), len(tank.rows), 10 * LATE_S * RATE
    is_good = all(each.is_none() for each in (first, at_from, stored_ahead, right, last, deaf))
    is_good = is_good and read <= MOST_READ * rows and not stored
    plant.close(is_good)
    print(f"collect_late: {last}; {late_rows} rows {LATE_S} s late and {rewritten} rewritten in three stretches, in "
          f"the place of 8 h and of 3 days; {read} rows read of {rows} in the source, {read / rows:.2f} each (at the "
          f"most {MOST_READ}); after the first pass {(read - history) / (rows - history):.2f} for each new row; a row "
          f"at `from` itself: {at_from}", flush=True)
    print(f"collect_ahead: {len(stored)} of {len(wrong)} rows {FAR_AHEAD_S} s ahead of the clock are stored; rows "
          f"{LITTLE_AHEAD_S} s ahead: {stored_ahead}; rows with right instants are in the stream {lag:.1f} s after: "
          f"{right}", flush=True)
    print(f"collect_deaf: {deaf_s:.0f} s after a connection to the source was lost without a word: {deaf}", flush=True)
    return is_good


def collect(options):
    """All measurements of the collector but for its speed."""
    if programs() is None:
        print("collect: NOT MEASURED: PostgreSQL is not installed", flush=True)
        return True
    return all([killed(options), away(options), late(options)])
