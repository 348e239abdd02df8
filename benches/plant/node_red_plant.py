"""An OPC UA server on loopback whose variables change by a rule, for `node_red`. It needs `asyncua`, and runs as a
process of its own.

    python3 benches/plant/node_red_plant.py FOLDER ADDRESS

Its address is the first line of its output; with port 0 the system chooses the port. Each value that it publishes
stands in FOLDER/published.jsonl with its instant, its status code and the number of monitored items that watched it. It
ends when its input ends, and publishes nothing more after a line there."""

import asyncio
import json
import math
import os
import sys
import threading
import time
from datetime import datetime, timedelta, timezone

from asyncua import Server, ua
from asyncua.common.utils import ServiceError
from asyncua.server.subscription_service import SubscriptionService

EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
STEP_S = 0.1
SENSOR_FAILURE, NO_COMMUNICATION, LAST_USABLE = 0x808C0000, 0x80310000, 0x40900000
TYPES = {"Pressure": ua.VariantType.Double, "Temperature": ua.VariantType.Float, "Valve": ua.VariantType.Boolean}


def republish(service, parameters):
    """A notification that was not acknowledged. asyncua answers an empty one where there is none, and a client that
    comes back then asks without end; the specification wants these status codes."""
    subscription = service.subscriptions.get(parameters.SubscriptionId)
    if subscription is None:
        raise ServiceError(ua.StatusCodes.BadSubscriptionIdInvalid)
    result = subscription._not_acknowledged_results.pop(parameters.RetransmitSequenceNumber, None)
    if result is None:
        raise ServiceError(ua.StatusCodes.BadMessageNotAvailable)
    return result.NotificationMessage


SubscriptionService.republish = republish


class Reading:
    """A value with its status code; the value may be missing."""

    def __init__(self, variable, value, status=0):
        self.variable, self.value, self.status = variable, value, status


def readings(step):
    """Readings that are published together at a step. Their quality differs at the same instant."""
    pressure = 2.0 + math.sin(step / 30) + step * 1e-6
    temperature = 60.0 + step % 400 / 8
    status = LAST_USABLE if step % 23 == 5 else SENSOR_FAILURE if step % 17 == 3 else 0
    if step % 29 == 7:
        yield Reading("Pressure", None, NO_COMMUNICATION)
    elif step % 41 == 11:
        yield Reading("Pressure", math.nan)
    else:
        yield Reading("Pressure", pressure, status)
    if step % 2 == 0:
        yield Reading("Temperature", temperature, SENSOR_FAILURE if step % 26 == 4 else 0)
    if step % 7 == 0:
        yield Reading("Valve", step % 14 == 0)


def data_value(reading, instant):
    kind = TYPES[reading.variable]
    variant = ua.Variant(None, ua.VariantType.Null) if reading.value is None else ua.Variant(reading.value, kind)
    return ua.DataValue(variant, StatusCode=ua.StatusCode(reading.status),
                        SourceTimestamp=EPOCH + timedelta(microseconds=instant))


def watched(server, variable):
    """How many monitored items of all subscriptions watch a variable."""
    subscriptions = server.iserver.subscription_service.subscriptions.values()
    items = (item for subscription in subscriptions
             for item in subscription.monitored_item_srv._monitored_items.values())
    return sum(item.read_value_id is not None and item.read_value_id.NodeId == variable.nodeid for item in items)


async def publish(server, variables, file, is_over):
    step, began = 0, time.monotonic()
    while not is_over.is_set():
        instant = time.time_ns() // 1000
        for reading in readings(step):
            variable = variables[reading.variable]
            count = watched(server, variable)
            await server.write_attribute_value(variable.nodeid, data_value(reading, instant))
            value = None if reading.value is None or math.isnan(reading.value) else float(reading.value)
            json.dump({"signal": reading.variable.lower(), "instant": instant, "value": value,
                       "status": reading.status, "watched": count}, file)
            file.write("\n")
        file.flush()
        step += 1
        await asyncio.sleep(max(0.0, began + step * STEP_S - time.monotonic()))


async def main(folder, address):
    server = Server()
    await server.init()
    server.set_endpoint(address)
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    space = await server.register_namespace("urn:greybox:tank")
    tank = await server.nodes.objects.add_object(ua.NodeId("Tank", space), f"{space}:Tank")
    variables = {}
    for name, kind in TYPES.items():
        variables[name] = await tank.add_variable(
            ua.NodeId(f"Tank.{name}", space), f"{space}:{name}", ua.Variant(False if name == "Valve" else 0.0, kind))
    is_over, is_closed, loop = asyncio.Event(), asyncio.Event(), asyncio.get_running_loop()

    def follow_input():
        sys.stdin.readline()
        loop.call_soon_threadsafe(is_over.set)
        sys.stdin.read()
        loop.call_soon_threadsafe(is_closed.set)

    async with server:
        port = server.bserver.port
        print(f"opc.tcp://127.0.0.1:{port} ns={space}", flush=True)
        threading.Thread(target=follow_input, daemon=True).start()
        with open(os.path.join(folder, "published.jsonl"), "a") as file:
            await publish(server, variables, file, is_over)
        await is_closed.wait()


asyncio.run(main(*sys.argv[1:]))
