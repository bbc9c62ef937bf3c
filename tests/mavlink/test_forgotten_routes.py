"""When a route is forgotten: links down, silence, restarts, another system, full tables."""

from __future__ import annotations

from mavlink_wire import Wire
from routed_net import AUTOPILOT, GROUND, SECOND, Net, vehicle_and_ground

from fwav_companion.geometry.stamps import NS_PER_S
from fwav_companion.mavlink.router.peers import MAX_PEERS, SILENT_NS


def test_a_link_that_goes_down_is_forgotten() -> None:
    net = Net()
    vehicle, ground = vehicle_and_ground(net)
    net.node.link_down("autopilot")
    assert net.links_of("ground", ground.attitude()) == ["tablet"]
    net.node.link_up("autopilot")
    assert net.links_of("ground", ground.command(1, 1)) == []
    net.feed("autopilot", vehicle.heartbeat())
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]


def test_the_silent_are_forgotten_and_the_others_are_not() -> None:
    net = Net()
    _, ground = vehicle_and_ground(net)
    net.wait(SILENT_NS - NS_PER_S)
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    net.wait(10 * NS_PER_S)
    assert net.links_of("ground", ground.command(1, 1)) == []


def test_a_restart_clears_the_systems_routes() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    vehicle, ground = Wire(1, 1), Wire(255, 190)
    net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, 90_000), Wire(1, 154).heartbeat(), Wire(2, 1).heartbeat())
    net.feed("second", Wire(1, 155).heartbeat())
    net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, 91_000))
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]
    rebooted = Wire(1, 1)
    for second in range(3):
        assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]
        net.feed("autopilot", rebooted.frame("SYSTEM_TIME", 0, 500 + 1000 * second))
        net.wait(NS_PER_S)
    assert net.links_of("ground", ground.command(1, 154)) == []
    assert net.links_of("ground", ground.command(1, 155)) == []
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    assert net.links_of("ground", ground.command(2, 1)) == ["autopilot"]


def test_a_forged_clock_clears_no_route_of_a_station_that_is_still_heard() -> None:
    net = Net()
    vehicle_and_ground(net)
    station = Wire(255, 190)
    net.feed("ground", station.frame("SYSTEM_TIME", 0, 90_000))
    for second in range(10):
        net.wait(NS_PER_S)
        net.feed("ground", station.heartbeat(6, 8))
        net.feed("tablet", Wire(255, 190).frame("SYSTEM_TIME", 0, 500 + second))
        assert "ground" in net.links_of("autopilot", Wire(1, 1).frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190))


def test_one_clock_that_goes_back_is_no_restart() -> None:
    net = Net(AUTOPILOT, GROUND)
    vehicle, ground = vehicle_and_ground(net)
    net.feed("autopilot", Wire(1, 154).heartbeat(26, 8))
    for boot_ms in (90_000, 500, 92_000, 600, 94_000):
        net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, boot_ms))
        net.wait(NS_PER_S)
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]


def test_clocks_of_different_components_are_not_compared() -> None:
    net = Net()
    _, ground = vehicle_and_ground(net)
    net.feed("autopilot", Wire(1, 1).frame("SYSTEM_TIME", 0, 90_000), Wire(1, 240).frame("SYSTEM_TIME", 0, 5))
    net.feed("autopilot", Wire(1, 154).heartbeat())
    net.feed("autopilot", Wire(1, 240).frame("SYSTEM_TIME", 0, 6))
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]


def test_strangers_do_not_fill_the_tables() -> None:
    net = Net()
    for system in range(1, 31):
        for component in range(1, 51):
            net.feed("ground", Wire(system, component).heartbeat())
    (link,) = [link for link in net.node.statistics(net.now) if link.name == "ground"]
    assert len(link.peers) <= MAX_PEERS


def test_adopting_a_system_forgets_our_own_under_it() -> None:
    net = Net(system=1)
    net.feed("ground", Wire(9, 191).heartbeat(18, 8))
    net.node.adopt(9)
    assert net.links_of("tablet", Wire(255, 1).command(9, 191)) == []
    assert net.node.system == 9


def test_adopting_the_same_system_again_changes_nothing() -> None:
    net = Net(system=9)
    version = net.node._router.version
    net.node.adopt(9)
    assert net.node._router.version == version
