"""A long run at four fifths of what a server can do, beside a neighbour that asks too much in ten ways.

The regular users are one project, the neighbour is another; one long job of the users is at work all the time. First
the capacity is measured, with the long job and small jobs at work: the highest of some fixed rates at which every
request is answered, 99 of 100 within 100 ms. The rates are shares of what the users' processes get answered when each
connection asks as soon as it was answered. Then 80 % of the capacity come for the whole time, while phases without the neighbour alternate with phases of each kind of it. The limits of requests are those
that a server has where nothing else is said; the users have a token for each connection, so that they stay below
them, and the neighbour has one.

The neighbour's processes have a lower priority (`os.nice(10)`): on one machine what they take themselves of the
processor would be counted against the server. What they take all the same is left out of the long job's speed in
share of that without a neighbour: that is of the processors that are left. What all processes take of the processors
is printed beside the figures.

The first cycle through all kinds of neighbour warms the server up; its memory is compared with that after this cycle.
"""

import contextlib
import ctypes
import multiprocessing
import multiprocessing.connection
import os
import resource
import signal
import tempfile
import time
from array import array
from collections import Counter

import neighbours
import regular
from server import Server, job, percentile

# Processes of the regular users.
PROCESSES = 4
CAPACITY_S, OFFERED_SHARE = 12, 0.8
# The shares of the fastest rate that are tried as the capacity, and the latency that it allows.
TRIED_SHARES, CAPACITY_P99_S = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3), 0.1
# What is left out at the beginning of the measurement of the capacity.
WARM_UP_SHARE = 0.25
# The long job: a recording of so many samples, and candidates of a generation.
LONG_SAMPLES, LONG_POPULATION = 100_000, 30
# The generation from which on the speed of the long job is about constant, and how long it is waited for.
SETTLED_GENERATION, SETTLING_S = 300, 120
# Minutes of a cycle through all kinds; a shorter run has a cycle all the same.
CYCLE_MINUTES = 15
# How long the neighbour is gone before the end of its phase, and which share of the phase at the most.
LEAVING_S, LEAVING_SHARE = 3, 0.15
# Unfinished jobs that a project may have: so few that the neighbour's queue is full within seconds.
MOST_UNFINISHED = 2000
# Finished jobs that the server keeps of a project.
KEPT_JOBS = 5000
# Tokens of the neighbour's project with which all of its jobs are cancelled; the first one alone asks for all else.
NEIGHBOUR_TOKENS = 5
# What is promised: the speed of the long job in share of that without a neighbour; the latency of the users.
LEAST_SPEED, MOST_LATENCY_FACTOR, MOST_LATENCY_S = 0.8, 5, 0.05
# Where a project's jobs are at work beside those of another one, each has half of the places.
FAIR_SHARE = {"floods of jobs": 0.5}
MEMORY_FACTOR, MEMORY_MIB = 1.1, 8
# The measurement of a phase that begins later than this share of its length says so: the server did not answer.
LATENESS_SHARE = 0.2
QUIET = "quiet"
FILES = 8192
# What `prctl` calls the signal that a process is sent when the process that started it ends.
ENDS_WITH_PARENT = 1
TICKS_PER_SECOND = os.sysconf("SC_CLK_TCK")

fork = multiprocessing.get_context("fork")


class Phase:
    def __init__(self, kind, begin, end):
        self.kind, self.begin, self.end = kind, begin, end
        self.speed = self.memory_mib = float("nan")
        self.waiting, self.share, self.processor = 0, 1.0, {}
        self.latencies, self.faults, self.example = array("f"), Counter(), b""
        self.answers, self.reports, self.is_late = Counter(), 0, False

    def take(self, latencies, faults, example):
        self.latencies.frombytes(latencies)
        self.faults.update(faults)
        self.example = self.example or example
        self.reports += 1

    def line(self):
        times = [1e3 * percentile(self.latencies, share) for share in (0.5, 0.99, 1)]
        processor = ", ".join(f"{name} {cores:.2f}" for name, cores in self.processor.items())
        text = (f"soak {self.kind:16} {times[0]:7.1f} {times[1]:7.1f} {times[2]:8.1f} {sum(self.faults.values()):7} "
                f"{self.share:6.0%} {self.memory_mib:6.0f} {self.waiting:7}  {processor}")
        if self.answers:
            text += "; " + ", ".join(f"{count} {kind}" for kind, count in self.answers.most_common(6))
        if self.faults:
            text += f"; FAULTS {dict(self.faults.most_common(4))} {self.example.decode(errors='replace')}"
        return text + ("; LATE: its speed and processor are not measured" if self.is_late else "")


HEADER = (f"soak {'neighbour':16} {'median':>7} {'p99':>7} {'longest':>8} {'faults':>7} {'speed':>6} {'memory':>6} "
          f"{'waiting':>7}  processor\n"
          f"     {'':16} {'ms':>7} {'ms':>7} {'ms':>8} {'':>7} {'':>6} {'MiB':>6} {'jobs':>7}  "
          "cores; answers to the neighbour")


def phases_of(minutes, begin):
    """Phases without a neighbour and with one in turn, of equal length, the first and the last without."""
    cycles = max(1, int(minutes / CYCLE_MINUTES))
    kinds = [kind for _ in range(cycles) for name in neighbours.KINDS for kind in (QUIET, name)] + [QUIET]
    length = 60 * minutes / len(kinds)
    return [Phase(kind, begin + k * length, begin + (k + 1) * length) for k, kind in enumerate(kinds)]


def processor_s(process):
    """Seconds that a process has had of the processor."""
    with contextlib.suppress(OSError), open(f"/proc/{process}/stat") as file:
        fields = file.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS_PER_SECOND
    return 0.0


def busy_s():
    """Seconds that all processors of the machine were at work."""
    with open("/proc/stat") as file:
        user, nice, system, _, _, *interrupts = map(int, file.readline().split()[1:8])
    return (user + nice + system + sum(interrupts)) / TICKS_PER_SECOND


class Soak:
    """The server, its users, and what is measured of them."""

    def __init__(self, options, folder):
        self.server = Server(options, folder, "--max-unfinished-jobs", str(MOST_UNFINISHED),
                             "--keep-jobs", str(KEPT_JOBS))
        tokens = [self.server.token(f"user-{k}", project="hall-1") for k in range(PROCESSES * regular.CONNECTIONS)]
        watcher = self.server.token("watcher", project="hall-1")
        abuser = [self.server.token(f"neighbour-{k}", project="neighbour") for k in range(NEIGHBOUR_TOKENS)]
        assert self.server.start(), "the server did not start"
        self.client = self.server.client(watcher)
        dataset = self.client.store(60)
        ended = self.client.submit(regular.small_job(dataset))
        assert self.client.ended(ended)["status"] == "succeeded"
        kept = neighbours.prepare(self.server.client(abuser[0]), abuser[0])
        spec = job(self.client.store(LONG_SAMPLES), 1_000_000, 1, LONG_POPULATION)
        spec["limits"] = {"max_duration_s": 86_400}
        self.plan = {"address": self.server.address, "tokens": tokens, "processes": PROCESSES, "dataset": dataset,
                     "ended": ended, "long": self.client.submit(spec), "neighbour_tokens": abuser, "kept": kept}
        # The job looks at its data first, and early generations hold candidates that take longer to simulate.
        latest = time.monotonic() + SETTLING_S
        while self.generation()[0] < SETTLED_GENERATION and time.monotonic() < latest:
            time.sleep(0.1)
        self.users, self.phases, self.printed, self.faults, self.requests = [], [], 0, 0, 0

    def start_users(self, rate, phases):
        """A pipe from each process of users."""
        pipes = []
        self.users = []
        for number in range(PROCESSES):
            receives, sends = fork.Pipe(duplex=False)
            users = fork.Process(target=children, args=(
                regular.run, self.plan, number, rate / PROCESSES, phases, sends), daemon=True)
            users.start()
            sends.close()
            self.users.append(users)
            pipes.append(receives)
        return pipes

    def capacity(self):
        """The highest of some rates [requests/s] at which every request is answered soon."""
        fastest, _, _ = self.trial(0)
        for share in TRIED_SHARES:
            rate, p99, faults = self.trial(share * fastest)
            if p99 <= CAPACITY_P99_S and not faults:
                return share * fastest
        raise AssertionError("no rate is answered soon")

    def trial(self, rate):
        """Requests a second that are answered at a rate, or as fast as they are where it is 0; their p99, and faults."""
        begin = time.monotonic() + 0.5
        middle, end = begin + WARM_UP_SHARE * CAPACITY_S, begin + CAPACITY_S
        pipes, faults = self.start_users(rate, [(begin, middle), (middle, end)]), Counter()
        measured = array("f")
        time.sleep(max(0.0, middle - time.monotonic()))
        before = self.processor()
        time.sleep(max(0.0, end - time.monotonic()))
        after = self.processor()
        for pipe in pipes:
            for place in range(2):
                _, latencies, counts, _ = pipe.recv()
                if place:
                    measured.frombytes(latencies)
                    faults.update(counts)
        taken = {name: (after[name] - before[name]) / (end - middle) for name in after}
        while self.waiting():
            time.sleep(0.2)
        answered, p99 = len(measured) / (end - middle), percentile(measured, 0.99)
        print(f"soak: {answered:.0f} requests/s answered of {rate or answered:.0f} with the jobs at work, p99 "
              f"{p99 * 1e3:.0f} ms; the users' processes took {taken['users']:.2f} cores and the server "
              f"{taken['server']:.2f}; {sum(faults.values())} faults {dict(faults) or ''}", flush=True)
        return answered, p99, faults

    def processor(self):
        """Seconds of the processor that the server, the users and, until they are taken off, all processes have had."""
        return {"server": processor_s(self.server.process.pid),
                "users": sum(processor_s(process.pid) for process in self.users), "rest": busy_s()}

    def generation(self):
        """The generation of the long job, and when it was read."""
        shown = None
        while shown is None:
            shown = self.client.show(self.plan["long"])
        assert shown["status"] in ("running", "queued"), shown
        return shown["progress"]["generation"], time.monotonic()

    def waiting(self):
        """Jobs of the users that wait in the queue, beside the long one."""
        _, page, _ = self.client.ask("GET", "/v1/jobs?status=queued&view=summary&limit=500")
        return sum(item["id"] != self.plan["long"] for item in page["items"]) if page else -1

    def start_neighbour(self, phase):
        leaving = min(LEAVING_S, LEAVING_SHARE * (phase.end - phase.begin))
        processes = []
        for _ in range(neighbours.PROCESSES):
            receives, sends = fork.Pipe(duplex=False)
            process = fork.Process(target=children, args=(
                neighbours.run, self.plan, phase.kind, phase.end - leaving, sends), daemon=True)
            process.start()
            sends.close()
            processes.append((process, receives))
        return processes, phase.end - leaving

    def measure(self, phase, pipes):
        """Watches one phase to its end."""
        while time.monotonic() < phase.begin:
            time.sleep(0.01)
        before, (first, began) = self.processor(), self.generation()
        processes, leaves = ([], phase.end) if phase.kind == QUIET else self.start_neighbour(phase)
        self.collect(pipes, leaves)
        time.sleep(max(0.0, leaves - time.monotonic()))
        taken = sum(processor_s(process.pid) for process, _ in processes)
        self.collect(pipes, phase.end)
        time.sleep(max(0.0, phase.end - time.monotonic()))
        after, (last, ended) = self.processor(), self.generation()
        for process, receives in processes:
            if receives.poll(0.1):
                phase.answers.update(receives.recv())
            process.kill()
            process.join()
        phase.is_late = began > phase.begin + LATENESS_SHARE * (phase.end - phase.begin)
        phase.speed = (last - first) / (ended - began)
        phase.memory_mib, phase.waiting = self.server.memory_mib(), self.waiting()
        phase.processor = {name: (after[name] - before[name]) / (ended - began) for name in after}
        if processes:
            phase.processor["neighbour"] = taken / (ended - began)
        # What takes of the processor beside this measurement spoils it.
        phase.processor["rest"] -= sum(cores for name, cores in phase.processor.items() if name != "rest")

    def collect(self, pipes, until):
        """Takes what the processes of users report until an instant."""
        def is_all():
            return all(phase.reports == PROCESSES for phase in self.phases)

        while pipes and not is_all() and (left_s := until - time.monotonic()) > 0:
            for pipe in multiprocessing.connection.wait(pipes, left_s):
                try:
                    place, *report = pipe.recv()
                    self.phases[place].take(*report)
                except EOFError:
                    pipes.remove(pipe)

    def print_lines(self, done):
        """Prints the phases of which all is known: their users' reports, and the speed in the phase after them."""
        while self.printed < done and self.phases[self.printed].reports == PROCESSES:
            place, phase = self.printed, self.phases[self.printed]
            if phase.kind != QUIET:
                if place + 1 >= done:
                    return
                processors_left = 1 - phase.processor["neighbour"] / os.cpu_count()
                usual = (self.phases[place - 1].speed + self.phases[place + 1].speed) / 2
                phase.share = phase.speed / usual / processors_left
            print(phase.line(), flush=True)
            self.requests += len(phase.latencies)
            self.faults += sum(phase.faults.values())
            phase.p99 = percentile(phase.latencies, 0.99)
            phase.latencies = array("f")
            self.printed += 1

    def run(self, minutes):
        rate = OFFERED_SHARE * self.capacity()
        begin = time.monotonic() + 1
        self.phases = phases_of(minutes, begin)
        print(f"soak: {rate:.0f} requests/s are offered; {len(self.phases)} phases of "
              f"{self.phases[0].end - begin:.1f} s\n{HEADER}", flush=True)
        pipes = self.start_users(rate, [(phase.begin, phase.end) for phase in self.phases])
        for place, phase in enumerate(self.phases):
            self.measure(phase, pipes)
            self.print_lines(place + 1)
        self.collect(pipes, self.phases[-1].end + regular.LATEST_ANSWER_S + 5)
        self.print_lines(len(self.phases))
        assert self.printed == len(self.phases), "a process of the users did not report"
        return self.verdict()

    def verdict(self):
        """The last line, and whether all is as promised."""
        quiet = [phase for phase in self.phases if phase.kind == QUIET]
        abusive = [phase for phase in self.phases if phase.kind != QUIET]
        usual = percentile([phase.p99 for phase in quiet], 0.5)
        worst = max(abusive, key=lambda phase: phase.p99)
        slowest = min(abusive, key=lambda phase: phase.share)
        quarter = max(2, len(quiet) // 4)
        first = max(phase.memory_mib for phase in quiet[1:1 + quarter])
        last, at_end = max(phase.memory_mib for phase in quiet[-quarter:]), quiet[-1].memory_mib
        print(f"soak: worst p99 {worst.p99 * 1e3:.0f} ms ({worst.kind}) beside {usual * 1e3:.0f} ms without a "
              f"neighbour; the long job at {slowest.share:.0%} of its speed at the least ({slowest.kind}); memory "
              f"{first:.0f} MiB in the first quarter, {last:.0f} MiB in the last, {at_end:.0f} MiB at the end; "
              f"{self.requests} requests, {self.faults} faults", flush=True)
        slow = [phase for phase in abusive if phase.share < LEAST_SPEED * FAIR_SHARE.get(phase.kind, 1)]
        late = [phase for phase in abusive if phase.p99 > max(MOST_LATENCY_FACTOR * usual, MOST_LATENCY_S)]
        # A run of one cycle says nothing of memory: each kind comes once.
        warm = quiet[len(neighbours.KINDS):][:3]
        grown = at_end > MEMORY_FACTOR * max(phase.memory_mib for phase in warm) + MEMORY_MIB
        return not (slow or late or grown or self.faults)


def children(work, *arguments):
    """The work of a process that ends with the process that started it."""
    ctypes.CDLL(None).prctl(ENDS_WITH_PARENT, signal.SIGKILL)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    work(*arguments)


def soak(options):
    """Regular users for `--minutes` beside a neighbour that asks too much."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(hard, max(soft, FILES)), hard))
    with tempfile.TemporaryDirectory() as folder:
        measurement = Soak(options, folder)
        good = measurement.run(options.minutes)
        for process in measurement.users:
            process.kill()
        measurement.server.terminate()
    return good
