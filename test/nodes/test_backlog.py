# SPDX-License-Identifier: Apache-2.0
"""When messages wait, all are looked at, the newest is used, and what is dropped is counted."""

from hypothesis import given
from hypothesis import strategies as st
from rclpy.qos import QoSProfile
from std_msgs.msg import Header, Int64

from intent_recognition.nodes.backlog import MAX_WAITING, Backlog, thin
from intent_recognition.nodes.conversions import to_stamp


@given(st.integers(1, 500), st.integers(1, 100))
def test_thinning_keeps_the_newest_and_the_order(n, most):
    kept = thin(range(n), most)
    assert len(kept) == min(n, most)
    assert kept[-1] == n - 1
    assert kept == sorted(set(kept))
    gaps = [b - a for a, b in zip([-1, *kept[:-1]], kept, strict=True)]
    assert max(gaps) - min(gaps) <= 1


def test_a_queue_that_grew_once_is_worked_off_and_one_that_goes_on_growing_is_thinned(harness):
    used, dropped = [], []
    n = 5 * MAX_WAITING
    qos = QoSProfile(depth=1000)

    def use(message: Int64) -> None:
        used.append(message.data)
        if message.data == n - 1:  # more has come meanwhile
            send(range(n, 2 * n))

    def send(numbers) -> None:
        for number in numbers:
            publisher.publish(Int64(data=number))

    Backlog(dropped.append).subscribe(harness.probe, Int64, "numbers", use, qos)
    publisher = harness.publisher(Int64, "numbers", qos)
    harness.connect(publisher)
    send(range(n))
    harness.spin_until(lambda: 2 * n - 1 in used, what="the newest")
    assert used[:n] == list(range(n))
    assert used == sorted(set(used))
    assert len(used) + sum(dropped) == 2 * n and dropped
    send([2 * n])  # and it goes on
    harness.spin_until(lambda: used[-1] == 2 * n, what="one more")


def test_topics_that_wait_together_are_used_in_the_order_of_their_stamps(harness):
    used, dropped = [], []
    qos = QoSProfile(depth=1000)
    backlog = Backlog(dropped.append)

    def use(message: Header) -> None:
        used.append(message.stamp.nanosec)

    for topic in ("a", "b", "c"):
        backlog.subscribe(harness.probe, Header, topic, use, qos)
    publishers = [harness.publisher(Header, topic, qos) for topic in ("a", "b", "c")]
    harness.connect(*publishers)
    for number in range(1, 46):  # none of the last topic: its square has no remainder of two
        publishers[(number * number) % 3].publish(Header(stamp=to_stamp(number)))
    harness.spin_until(lambda: len(used) == 45, what="all")
    assert used == list(range(1, 46)) and not dropped
    assert len(backlog.close(harness.probe)) == 3 and backlog.close(harness.probe) == []
