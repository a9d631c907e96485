#!/usr/bin/python3
"""The map through its topics: ~update from the start, from a late join and after a gap, the whole clouds, markers, diagnostics."""
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
import zlib

import numpy
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from frontier_surfels.msg import FrameReport, SurfelUpdate
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import Marker, MarkerArray

from mapper_client import Mapper, MapperTest, run, to_array, wait_until


class Follower:
    """A copy of a map that follows the rules of SurfelUpdate.msg."""

    def __init__(self, mapper, lose=()):
        self.mapper, self.lose = mapper, set(lose)
        self.surfels, self.sequence, self.gaps, self.whole, self.received = {}, 0, 0, 0, 0
        self.parts, self.most_parts = [], 0
        self.faults = []
        self.subscriber = rospy.Subscriber(f'{mapper.name}/update', SurfelUpdate, self.receive)

    def receive(self, update):
        self.received += 1
        if self.received in self.lose:
            return
        try:
            self.apply(update)
        except Exception as fault:  # rospy would only log it
            self.faults.append(fault)

    def apply(self, update):
        self.most_parts = max(self.most_parts, update.parts)
        if update.part != len(self.parts):
            self.parts = []
            if update.part != 0:
                return
        self.parts.append(update)
        if len(self.parts) < update.parts:
            return
        parts, self.parts = self.parts, []
        assert len({(part.since, part.sequence, part.parts) for part in parts}) == 1
        update.removed = sum((part.removed for part in parts), ())
        changed = numpy.concatenate([to_array(part.surfels) for part in parts])
        self.check_box(update, changed)
        if update.since == 0:
            self.surfels, self.sequence = {}, 0
            self.whole += 1
        elif update.sequence <= self.sequence:
            return
        elif update.since > self.sequence:
            self.gaps += 1
            sequence, surfels = self.mapper.map()
            self.surfels = {surfel['id']: surfel.tobytes() for surfel in surfels}
            self.sequence = sequence
            return
        else:
            assert update.since == self.sequence, (update.since, self.sequence)
        for number in update.removed:
            self.surfels.pop(number, None)
        for surfel in changed:
            self.surfels[surfel['id']] = surfel.tobytes()
        self.sequence = update.sequence

    @staticmethod
    def check_box(update, changed):
        """The box contains all changed surfels. Removed surfels may make it larger, also those of the map before a whole one."""
        for axis in 'xyz':
            low, high = getattr(update.box_min, axis), getattr(update.box_max, axis)
            if len(changed):
                assert low <= changed[axis].min() + 1e-5 and changed[axis].max() <= high + 1e-5, (axis, low, high)
            elif not update.removed and update.since > 0:
                assert low > high, (axis, low, high)

    def bytes(self):
        return b''.join(self.surfels[number] for number in sorted(self.surfels))


class Updates(MapperTest):
    def follow(self, **options):
        follower = Follower(self.mapper, **options)
        self.addCleanup(follower.subscriber.unregister)
        wait_until(lambda: follower.subscriber.get_num_connections(), what='~update')
        return follower

    def check_followed(self, follower):
        sequence, surfels = self.mapper.map()
        wait_until(lambda: follower.sequence >= sequence or follower.faults, 10, f'update {sequence}, at {follower.sequence}')
        self.assertEqual(follower.faults, [])
        self.assertEqual(follower.sequence, sequence)
        self.assertGreater(len(surfels), 1000)
        self.assertEqual(follower.bytes(), surfels.tobytes())

    def check_cloud(self, topic, expected):
        """A new subscriber gets the cloud without a new frame. An older latched cloud may come first."""
        clouds = []
        subscriber = rospy.Subscriber(f'mapper/{topic}', PointCloud2, clouds.append)
        self.addCleanup(subscriber.unregister)
        wait_until(lambda: clouds and to_array(clouds[-1]).tobytes() == expected.tobytes(), 10, f'the right ~{topic}')
        self.assertEqual(clouds[-1].header.frame_id, 'map')

    def test_updates_from_the_start(self):
        follower = self.follow()
        for step in range(4):
            self.map_walk(1, first=step)
            self.check_followed(follower)
        self.assertEqual(follower.gaps, 0)
        self.assertLessEqual(follower.whole, 1)

    def test_updates_from_a_late_join(self):
        """A new subscriber gets the whole map without a new frame, and older subscribers are not disturbed."""
        early = self.follow()
        self.map_walk(3)
        late = subprocess.Popen([sys.executable, __file__, '--follow'], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        self.addCleanup(late.communicate)  # ends its input, and thereby the process
        for first in (3, 5):
            sequence, surfels = self.mapper.map()
            print(sequence, file=late.stdin, flush=True)
            self.assertEqual(late.stdout.readline(), f'{sequence} {zlib.crc32(surfels.tobytes())} gaps 0\n')
            self.map_walk(2, first)
        self.check_followed(early)
        self.assertEqual(early.gaps, 0)

    def test_a_lost_update_is_noticed(self):
        follower = self.follow()
        self.map_walk(1)
        self.check_followed(follower)
        follower.lose = {follower.received + 1}
        self.map_walk(3, first=1)
        self.check_followed(follower)
        self.assertEqual(follower.gaps, 1)

    def test_updates_over_reset_and_load(self):
        follower = self.follow()
        self.map_walk(2)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, 'map.ply')
            self.assertTrue(self.mapper.save(path).success)
            self.mapper.reset()
            self.map_walk(1, first=5)
            self.check_followed(follower)
            self.assertTrue(self.mapper.load(path).success)
        self.check_followed(follower)
        self.map_walk(1, first=2)
        self.check_followed(follower)
        self.assertEqual(follower.gaps, 0)

    def test_whole_clouds_for_late_joiners(self):
        self.map_walk(3)
        surfels = self.mapper.surfels()
        self.check_cloud('surfels', surfels)
        for topic, label in (('occupied', 1), ('frontier', 0)):
            part = surfels[surfels['label'] == label]
            self.assertGreater(len(part), 100)
            self.check_cloud(topic, part)

    def test_markers(self):
        shown = {}

        def receive(array):
            for marker in array.markers:
                if marker.action == Marker.DELETEALL:
                    shown.clear()
                elif marker.action == Marker.DELETE:
                    shown.pop((marker.ns, marker.id), None)
                else:
                    shown[marker.ns, marker.id] = marker

        subscriber = rospy.Subscriber('mapper/markers', MarkerArray, receive)
        self.addCleanup(subscriber.unregister)
        wait_until(subscriber.get_num_connections, what='~markers')
        self.map_walk(3)
        names = lambda: {name for name, _ in list(shown)}
        wait_until(lambda: names() >= {'occupied', 'frontier', 'camera', 'counts'}, 10, 'all kinds of markers')
        self.assertEqual({marker.header.frame_id for marker in shown.values()}, {'map'})
        for marker in [marker for (name, _), marker in shown.items() if name == 'frontier']:
            colors = numpy.array([[color.r, color.g, color.b] for color in marker.colors or [marker.color]])
            self.assertTrue((colors[:, 2] > 1.2 * colors[:, :2].max(axis=1)).all())  # blue
        self.mapper.reset()
        wait_until(lambda: not names() & {'occupied', 'frontier'}, 10, 'the markers to be deleted')

    def median_latency(self, steps):
        latencies = []
        for step in range(steps):
            latencies.append(self.map_walk(1, first=step % 8).latency_ms)
            time.sleep(0.02)
        return statistics.median(latencies)

    def start_stopped_subscriber(self, topic):
        """Starts a subscriber that stops reading as soon as it has got a message."""
        process = subprocess.Popen(['rostopic', 'echo', '--noarr', f'mapper/{topic}'], stdout=subprocess.PIPE)
        self.addCleanup(process.stdout.close)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        self.assertTrue(process.stdout.readline())
        process.send_signal(signal.SIGSTOP)

    def test_slow_subscribers_slow_nothing(self):
        self.map_walk(8)
        alone = self.median_latency(20)
        for topic in ('update', 'surfels', 'markers'):
            self.start_stopped_subscriber(topic)
        together = self.median_latency(60)
        self.assertLess(together, 1.5 * alone + 10)
        self.check_followed(self.follow())  # other subscribers still get everything

    def test_diagnostics(self):
        received = []

        def receive(array):
            received.extend(status for status in array.status if 'mapper' in status.name)

        subscriber = rospy.Subscriber('/diagnostics', DiagnosticArray, receive)
        self.addCleanup(subscriber.unregister)
        header = self.camera.send(0, send_pose=False)
        report = self.map_walk(2)
        self.check_dropped(header, FrameReport.DROPPED_NO_POSE, '.')
        received.clear()  # diagnostics from before the image was dropped

        def mapping():
            values = [{entry.key: entry.value for entry in status.values} for status in received if status.level == 0]
            return [value for value in values if value.get('surfels') == str(report.surfels)]

        values = wait_until(mapping, 10, 'diagnostics of the map')[-1]
        self.assertGreaterEqual(int(values['frames dropped: no pose']), 1)
        self.assertGreaterEqual(int(values['frames integrated']), 2)
        self.assertTrue(values['device'])


def follow_elsewhere():
    """The main program of a follower in another node, because subscribers in one node share a connection. For every sequence number on its
    input it waits for that map, and prints what it has."""
    rospy.init_node('late', anonymous=True)
    follower = Follower(Mapper())
    for line in sys.stdin:
        wait_until(lambda: follower.sequence >= int(line) or follower.faults, 10, f'update {line}')
        print(follower.sequence, zlib.crc32(follower.bytes()), 'gaps', follower.gaps, *follower.faults, flush=True)


if __name__ == '__main__':
    if '--follow' in sys.argv:
        sys.exit(follow_elsewhere())
    run('test_updates', Updates)
