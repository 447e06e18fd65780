"""The policy process of a real robot: sixty times a second it looks, decides, and tells control a target."""

import os
import time

from contactsafe.core.errors import ContactSafeError
from contactsafe.core.process import ignore_terminal
from contactsafe.hardware.exchange import Exchange
from contactsafe.hardware.heartbeats import Heartbeats
from contactsafe.hardware.mailbox import receive
from contactsafe.hardware.states import POLICY_DEAD, POLICY_DONE
from contactsafe.policy.actor import Actor, PolicySettings
from contactsafe.policy.rate import ticks_of_step

_NAP_S = 0.0003


def act_on_robot(exchange_path: str, settings: PolicySettings) -> None:
    """Be the policy process of a run, until that ends.

    Args:
        exchange_path: of its shared memory.
        settings: as given.
    """
    ignore_terminal()
    exchange = Exchange(exchange_path)
    status = exchange.status
    status["pid_policy"] = os.getpid()
    work = settings.work
    try:
        work.prepare(settings.arm, settings.lockstep, settings.speed)
        actor = Actor(settings, exchange)
        status["ready_policy"] = 0
        status["beat_policy"] += 1
        _follow(actor, exchange)
    except ContactSafeError as error:
        print(f"policy: {error}", flush=True)
        exchange.ask_to_stop(POLICY_DEAD)
    finally:
        work.close()


def _follow(actor: Actor, exchange: Exchange) -> None:
    """Step whenever the control process has come to the tick of the next step."""
    status, step, due = exchange.status, 0, 1
    heartbeats = Heartbeats(status)
    while not status["finished"][0] and not heartbeats.have_stopped():
        sequence = receive(exchange.seen, actor.seen_words)
        tick = int(actor.seen["tick"][0]) if sequence > 0 else 0
        if tick < due:
            if sequence > 0:
                status["ready_policy"] = tick
            time.sleep(0 if actor.settings.lockstep and sequence > 0 else _NAP_S)
            continue
        actor.step()
        if actor.done:
            exchange.ask_to_stop(POLICY_DONE)
            status["ready_policy"] = tick
            return
        status["ready_policy"] = tick
        while due <= tick:  # a step that came late is left out
            due += int(ticks_of_step(step))
            step += 1
