"""Samples that Node-RED brings from an OPC UA server into streams, by the flow of `openapi/clients/node-red` and by its
nodes without a queue, are compared with what the OPC UA server published. greybox and the OPC UA server are killed and
are away meanwhile.

The folder of `--tools` has `node_modules` with Node-RED and its nodes, and `venv` with asyncua."""

import atexit
import collections
import http.client
import json
import os
import shutil
import subprocess
import tempfile
import time

from collect_sources import Content, Difference, instants_of
from postgres import HOST, free_port
from server import Server

HERE = os.path.dirname(os.path.abspath(__file__))
FLOW = os.path.join(HERE, "..", "..", "openapi", "clients", "node-red", "flow.json")
PACKAGES = ("node-red", "node-red-contrib-opcua", "node-red-contrib-influxdb")
SECONDS = 60
# greybox is away for so long [s]; for `node_red_away` longer than the influxdb node tries again.
AWAY_S, LONG_AWAY_S = 8, 240
# The OPC UA server is away for so long [s], longer than the flow takes its silence.
SOURCE_AWAY_S = 45
# Node-RED, its subscription and its way back may take so long on a busy machine [s].
START_S = 300
# The last samples may take so long to their streams [s].
PATIENCE_S = 45
# Severities of OPC UA stand in the two top bits of a status code.
UNCERTAIN, BAD = 1, 2
# The flow writes into a stream of its own, and so do its nodes without a queue.
STREAMS = {"with the queue": "tank", "without a queue": "tank-direct"}
SIGNALS = {"pressure": {"signal": "pressure", "unit": "bar"},
           "temperature": {"signal": "temperature", "unit": "°C"},
           "valve": {"signal": "valve", "interpolation": "hold"}}
VARIABLES = {"pressure": "Tank.Pressure", "temperature": "Tank.Temperature", "valve": "Tank.Valve"}


def in_si(name, value):
    return value * 1e5 if name == "pressure" else value + 273.15 if name == "temperature" else value


class OpcUa:
    """An OPC UA server as a process, and what it has published."""

    def __init__(self, options, folder):
        self.tools, self.folder, self.path = options.tools, folder, os.path.join(folder, "published.jsonl")
        self.address, self.process = f"opc.tcp://{HOST}:0", None
        self.start()
        atexit.register(self.kill)

    def start(self):
        program = os.path.join(HERE, "node_red_plant.py")
        command = [os.path.join(self.tools, "venv", "bin", "python"), program, self.folder, self.address]
        with open(os.path.join(self.folder, "opcua.log"), "a") as log:
            self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log,
                                            text=True)
        self.address, space = self.process.stdout.readline().split()
        self.nodes = {field: f"{space};s={name}" for field, name in VARIABLES.items()}

    def published(self):
        """The readings so far; a line that is being written is left out."""
        with open(self.path) as file:
            return [json.loads(line) for line in file if line.endswith("\n")]

    def stop(self):
        """Publishes nothing more."""
        self.process.stdin.write("\n")
        self.process.stdin.flush()
        time.sleep(1)

    def kill(self):
        self.process.kill()
        self.process.wait()


class NodeRed:
    """Node-RED as a process with a folder of its own, in which it keeps flows, secrets and certificates."""

    def __init__(self, options, folder):
        self.folder, self.port, self.process = os.path.join(folder, "node-red"), free_port(), None
        self.log = os.path.join(folder, "node-red.log")
        os.makedirs(self.folder)
        settings = {"uiHost": HOST, "uiPort": self.port, "credentialSecret": False, "flowFile": "flows.json",
                    "telemetry": {"enabled": False}, "logging": {"console": {"level": "warn"}}}
        path = os.path.join(self.folder, "settings.js")
        with open(path, "w") as file:
            file.write(f"module.exports = {json.dumps(settings)};\n")
        program = os.path.join(options.tools, "node_modules", "node-red", "red.js")
        self.command = ["node", program, "--userDir", self.folder, "--settings", path]
        atexit.register(self.kill)

    def start(self):
        environment = {**os.environ, "HOME": self.folder, "XDG_CONFIG_HOME": self.folder}
        with open(self.log, "a") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log, env=environment)
        until = time.monotonic() + START_S
        while self.ask("GET", "/flows")[0] != 200:
            assert time.monotonic() < until and self.process.poll() is None, f"Node-RED did not start; see {self.log}"
            time.sleep(0.5)

    def ask(self, method, path, body=None):
        connection = http.client.HTTPConnection(HOST, self.port, timeout=30)
        headers = {"content-type": "application/json", "Node-RED-Deployment-Type": "full"}
        try:
            connection.request(method, path, body, headers)
            answer = connection.getresponse()
            return answer.status, answer.read()
        except (OSError, http.client.HTTPException):
            return 0, b""
        finally:
            connection.close()

    def deploy(self, nodes):
        status, text = self.ask("POST", "/flows", json.dumps(nodes))
        assert status == 204, (status, text)

    def memory_mib(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            line = next(line for line in status if line.startswith("VmHWM"))
        return int(line.split()[1]) / 1024

    def kill(self):
        if self.process is not None:
            self.process.kill()
            self.process.wait()


def filled_in(nodes, opc_ua, url, bucket, token):
    """The flow with the five fields that a person fills in."""
    fields = {"OPC_UA": opc_ua.address, "VARIABLES": json.dumps({"tank": opc_ua.nodes}), "GREYBOX": url,
              "BUCKET": bucket}
    tab = next(node for node in nodes if node["type"] == "tab")
    for variable in tab["env"]:
        if variable["type"] == "cred":
            tab["credentials"] = {variable["name"]: token}
        else:
            variable["value"] = fields[variable["name"]]
    return nodes


def with_direct_way(nodes, token, is_alone):
    """Adds a way from the OPC UA client to a stream, on which points go to the influxdb node as they come, or puts it
    in the place of the way with the queue. A token of its own keeps the requests of the ways apart."""
    client = next(node for node in nodes if node["type"] == "OpcUa-Client")
    way = [node for node in nodes if node.get("name") in ("Points", "Queue") or node["type"].startswith("influxdb")]
    text = json.dumps(way)
    for node in way:
        text = text.replace(f'"{node["id"]}"', f'"{node["id"]}-direct"')
    way = json.loads(text)
    points, queue, write, server = (next(node for node in way if name in (node.get("name"), node["type"]))
                                    for name in ("Points", "Queue", "influxdb batch", "influxdb"))
    server["credentials"] = {"token": token}
    queue["func"] = "return { payload: [msg.point] };"
    write["bucket"] = STREAMS["without a queue"]
    client["wires"][0] = [points["id"]] if is_alone else client["wires"][0] + [points["id"]]
    return nodes + way


class Study:
    """An OPC UA server, a Node-RED with the flow in one form or both, and a greybox that asks for tokens."""

    def __init__(self, options, forms=tuple(STREAMS)):
        self.streams = {form: STREAMS[form] for form in forms}
        self.folder = tempfile.mkdtemp(prefix="node-red-")
        self.opc_ua, self.node_red = OpcUa(options, self.folder), NodeRed(options, self.folder)
        self.server = Server(options, self.folder, database="streams.db")
        reader = self.server.token("reader", "admin")
        self.tokens = {stream: self.append_token(stream) for stream in STREAMS.values()}
        self.start_server()
        self.server.listen = "{}:{}".format(*self.server.address)
        self.client = self.server.client(reader)
        for stream in STREAMS.values():
            rule = {"measurement": "tank", "stream": stream, "signals": SIGNALS,
                    "quality": {"fields": ["status"], "codes": "opc_ua"}}
            status, body, _ = self.client.ask("PUT", f"/v1/mappings/{stream}", {"rules": [rule]})
            assert status in (200, 201, 204), (status, body)

    def append_token(self, stream):
        _, answer = self.server.command("token", "create", "--name", f"node-red-{stream}", "--scope", "append",
                                        "--streams", stream)
        return next(word for word in answer.split() if word.startswith("gbx_"))

    def start_server(self):
        until = time.monotonic() + 30
        while not self.server.start():
            assert time.monotonic() < until, "the server did not start"
            time.sleep(0.05)

    def deploy(self):
        """Deploys the flow; ends when it watches all variables."""
        self.node_red.start()
        with open(FLOW) as file:
            nodes = json.load(file)
        if "without a queue" in self.streams:
            nodes = with_direct_way(nodes, self.tokens[STREAMS["without a queue"]], len(self.streams) == 1)
        bucket, url = STREAMS["with the queue"], f"http://{self.server.listen}"
        self.node_red.deploy(filled_in(nodes, self.opc_ua, url, bucket, self.tokens[bucket]))
        self.wait_for_watch()

    def wait_for_watch(self):
        """Waits until all variables are watched."""
        until = time.monotonic() + START_S
        while {reading["signal"] for reading in self.opc_ua.published() if reading["watched"]} != set(SIGNALS):
            assert time.monotonic() < until, f"not all variables are watched; see {self.node_red.log}"
            time.sleep(0.5)

    def kill_server(self, away_s):
        """Kills greybox and starts it after so long; the instants that were published until then."""
        self.server.kill()
        time.sleep(away_s)
        self.start_server()
        return {reading["instant"] for reading in self.readings()}

    def readings(self):
        """The readings since their variable is watched. The subscription begins with the reading before."""
        before, readings = {}, []
        for reading in self.opc_ua.published():
            signal = reading["signal"]
            if reading["watched"] and signal in before:
                readings.append(before.pop(signal))
            if reading["watched"]:
                readings.append(reading)
            else:
                before[signal] = reading
        return readings

    def content(self, stream):
        """What the stream is to have, and how many readings are of each severity."""
        content, counts = Content(stream), collections.Counter()
        for reading in self.readings():
            severity = BAD if reading["value"] is None else reading["status"] >> 30
            value = None if reading["value"] is None else in_si(reading["signal"], reading["value"])
            content.keep_with_quality(reading["instant"], reading["signal"], value, severity < BAD)
            counts[severity] += 1
        return content, counts

    def wait(self, instants, patience):
        """How long it takes until a stream has instants, for each form of the flow; nothing where they do not come."""
        began, times = time.monotonic(), dict.fromkeys(self.streams)
        while None in times.values() and time.monotonic() - began < patience:
            for form, stream in self.streams.items():
                if times[form] is None and instants <= set(instants_of(self.client, stream)):
                    times[form] = time.monotonic() - began
            time.sleep(0.5)
        return times

    def report(self, name, notes):
        """Prints how the streams differ from what was published, with notes; whether the queue lost nothing."""
        self.opc_ua.stop()
        self.wait({reading["instant"] for reading in self.readings()}, PATIENCE_S)
        memory, is_good = self.node_red.memory_mib(), True
        for form, stream in self.streams.items():
            difference = Difference()
            content, counts = self.content(stream)
            difference.add(self.client, content)
            print(f"{name}: {form}: {sum(counts.values())} values published, {counts[UNCERTAIN]} uncertain and "
                  f"{counts[BAD]} bad; {difference}; {notes[form]}", flush=True)
            is_good = is_good and (difference.is_none() or form != "with the queue")
        print(f"{name}: {memory:.0f} MiB of memory for Node-RED at the most", flush=True)
        return is_good

    def close(self, is_good):
        for process in (self.node_red, self.opc_ua):
            process.kill()
        if self.server.process.poll() is None:
            self.server.terminate()
        if is_good:
            shutil.rmtree(self.folder)
        else:
            print(f"node_red: the logs and the database stay in {self.folder}", flush=True)


def versions(options):
    """The versions of what is measured."""
    names = []
    for package in PACKAGES:
        with open(os.path.join(options.tools, "node_modules", package, "package.json")) as file:
            names.append(f"{package} {json.load(file)['version']}")
    asyncua = "import importlib.metadata as m; print('asyncua', m.version('asyncua'))"
    for command in (["node", "--version"], [os.path.join(options.tools, "venv", "bin", "python"), "-c", asyncua]):
        names.append(subprocess.run(command, capture_output=True, text=True).stdout.strip())
    return ", ".join(names)


def run(options, name, away_s, forms=tuple(STREAMS)):
    """Publishes for so long and while greybox is away, which it is after a third."""
    seconds, study = options.seconds or SECONDS, Study(options, forms)
    study.deploy()
    time.sleep(seconds / 3)
    before = study.kill_server(away_s)
    times = study.wait(before, PATIENCE_S)
    time.sleep(seconds / 3)
    notes = {form: f"greybox killed and away for {away_s} s: " +
             (f"all was there {took:.1f} s after it came back" if took is not None else "not all came")
             for form, took in times.items()}
    is_good = study.report(name, notes)
    study.close(is_good)
    return is_good


def source(options, name, seconds):
    """The OPC UA server is killed and away, with the values that it had not sent yet."""
    study = Study(options)
    study.deploy()
    time.sleep(seconds / 3)
    study.opc_ua.kill()
    time.sleep(SOURCE_AWAY_S)
    back = time.time_ns() // 1000
    study.opc_ua.start()
    stream, until = STREAMS["with the queue"], time.monotonic() + START_S
    while max(instants_of(study.client, stream)) < back:
        assert time.monotonic() < until, f"no values come after the OPC UA server; see {study.node_red.log}"
        time.sleep(0.5)
    took = time.time_ns() / 1e9 - back / 1e6
    time.sleep(seconds / 3)
    note = f"the OPC UA server killed and away for {SOURCE_AWAY_S} s: values came again {took:.0f} s after its start"
    study.report(name, dict.fromkeys(STREAMS, note))
    study.close(True)
    return True


def is_measured(options, name):
    if not options.tools:
        print(f"{name}: NOT MEASURED: --tools names no folder with Node-RED", flush=True)
    else:
        print(f"{name}: {versions(options)}", flush=True)
    return bool(options.tools)


def node_red(options):
    """The flow while greybox is away for a moment, and while the OPC UA server is."""
    if not is_measured(options, "node_red"):
        return True
    is_good = run(options, "node_red", AWAY_S)
    return source(options, "node_red_source", options.seconds or SECONDS) and is_good


def node_red_away(options):
    """The flow while greybox is away for longer than the influxdb node tries again. The trials of the influxdb node
    without a queue are so many that they would hold up the way with the queue: each has its processes."""
    if not is_measured(options, "node_red_away"):
        return True
    return all([run(options, "node_red_away", LONG_AWAY_S, (form,)) for form in STREAMS])


ALL = {"node_red": node_red, "node_red_away": node_red_away}
