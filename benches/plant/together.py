"""What several nodes do of one job together, and nodes that are upgraded one after the other."""

import copy
import time

from nodes import Plant, needs_postgres
from server import job

# Searches of one job, and generations of each, over a recording of so many samples.
SEARCHES, GENERATIONS, SAMPLES = 12, 200, 10_000
# Refits of one analysis, over a recording of so many.
REFITS, FEW_SAMPLES = 6000, 300
# The most nodes.
NODES = 3
# What the nodes have to know of each other before a job comes.
ACQUAINTED_S = 3


def work(plant, spec, samples):
    """How long a job takes [s], and what others did of it."""
    client = plant.nodes[0].client()
    spec["experiments"][0]["dataset"] = client.store(samples)
    began = time.monotonic()
    client.ended(client.submit(spec))
    took = time.monotonic() - began
    done = 0
    for node in plant.nodes:
        _, metrics, _ = node.client().ask("GET", "/metrics")
        lines = (line.rsplit(" ", 1) for line in metrics.decode().splitlines() if "_for_others_total " in line)
        done += sum(int(count) for name, count in lines if not name.startswith("#"))
    return took, done


def together(options):
    """One job on one node, on two and on three."""
    searched = job("", GENERATIONS, restarts=SEARCHES)
    analysed = job("", 20)
    analysed["uncertainty"] = {"intervals": "bootstrap", "bootstrap_samples": REFITS}
    jobs = {f"{SEARCHES} searches of {GENERATIONS} generations": (searched, SAMPLES),
            f"{REFITS} refits of a bootstrap": (analysed, FEW_SAMPLES)}
    for what, (spec, samples) in jobs.items():
        spec["parameters"]["coulomb_friction"] = {"value": 0}
        for number in range(1, NODES + 1):
            figures = []
            for _ in range(options.count or 2):
                plant = Plant(options, slice_s=10, number=number)
                time.sleep(ACQUAINTED_S)
                took, done = work(plant, copy.deepcopy(spec), samples)
                figures.append(f"{took:.1f} s ({done} by others)")
                plant.close()
            print(f"nodes_together: {what} on {number} nodes of one thread: {', '.join(figures)}", flush=True)
    return True


def upgrade(options):
    """Nodes of a newer program take the place of others, one after the other, and then of the older one again."""
    if not options.next:
        print("nodes_upgrade: NOT MEASURED: --next names no other program")
        return True
    plant, longest = Plant(options), 0.0
    older, schemas = options.program, []
    for program in (options.next, older):
        for number in range(NODES):
            plant.wait(3)
            plant.nodes[number].process.terminate()
            options.program = program
            plant.renew(number)
            longest = max(longest, plant.goes_on())
        schemas.append(plant.database.number("select max(version) from _sqlx_migrations"))
    plant.wait(3)
    dead = plant.dead()
    good = plant.end(f"nodes_upgrade: schema {schemas[0]:.0f}, then nodes of the older program again; slices go on "
                     f"after {longest:.1f} s at the most, {dead} declared dead")
    return good and not dead


ALL = {f"nodes_{measure.__name__}": needs_postgres(measure) for measure in (together, upgrade)}
