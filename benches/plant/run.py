#!/usr/bin/env python3
"""What a server withstands on a plant's network, measured on the program as it is built.

    python3 benches/plant/run.py full slow turns --program target/release/greybox

Each prints a line of figures; the status is 1 where one is not what was promised. It needs nothing beyond
Python itself and Linux; those whose names begin with `nodes` or `collect` need a PostgreSQL, and `bytes` uses one where
there is one; those that begin with `collect` use an InfluxDB 1 where there is one; those that begin with `node_red` need Node-RED and
asyncua in the folder of `--tools`. Servers listen on loopback, with
databases of their own in the folder for temporary files.
"""

import argparse
import os
import signal
import sys

import bytes as changed_bytes
import collect
import collect_speed
import kept
import node_red
import nodes
import outside
import overlap
import resources
import soak
import together

HERE = os.path.dirname(os.path.abspath(__file__))
ALL = {
    "full": outside.full,
    "slow": outside.slow,
    "stops": outside.stops,
    "kills": outside.kills,
    "clock": outside.clock,
    "turns": outside.turns,
    "cost": kept.cost,
    "backup": kept.backup,
    "damage": kept.damage,
    "resources": resources.resources,
    "memory": kept.memory,
    "soak": soak.soak,
    "bytes": changed_bytes.bytes_,
    **nodes.ALL,
    **overlap.ALL,
    **together.ALL,
    "collect": collect.collect,
    "collect_speed": collect_speed.collect_speed,
    **node_red.ALL,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", nargs="+", choices=ALL)
    parser.add_argument("--program", default=os.path.join(HERE, "..", "..", "target", "release", "greybox"))
    parser.add_argument("--count", type=int, help="how many: times, clients, trials, kills, jobs, requests, days")
    parser.add_argument("--seconds", type=float, help="how long `slow` looks at a time, and a plant publishes for `node_red`")
    parser.add_argument("--minutes", type=float, default=8, help="how long `cost` begins jobs, and `soak` lasts")
    parser.add_argument("--faketime", help="libfaketime.so.1, for `clock` and `nodes_clock`")
    parser.add_argument("--tools", help="folder with `node_modules` and `venv`, for `node_red`")
    parser.add_argument("--next", help="another build of the program, for `nodes_upgrade`")
    options = parser.parse_args()
    # Ended from outside it still ends its servers.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("ended from outside"))
    good = [ALL[what](options) for what in options.what]
    sys.exit(0 if all(good) else 1)


main()
