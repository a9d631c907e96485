#!/usr/bin/python3
"""A map that is larger than a message may be: updates and answers in parts, and what is said where there are none."""
import numpy
import rospy
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import PointCloud2

from mapper_client import MapperTest, run, wait_until
from test_updates import Follower


class InParts(MapperTest):
    """A mapper whose messages have at most 5000 surfels each, which is less than its map has. Smaller messages would be too many for the queue
    of a slow subscriber."""

    def test_updates(self):
        follower = Follower(self.mapper)
        self.addCleanup(follower.subscriber.unregister)
        wait_until(follower.subscriber.get_num_connections, what='~update')
        for step in range(3):
            report = self.map_walk(1, first=step)
            wait_until(lambda: follower.sequence >= report.sequence or follower.faults, 10, f'update {report.sequence}')
            self.assertEqual(follower.faults, [])
        self.assertGreater(follower.most_parts, 2)
        self.assertEqual(follower.gaps, 0)
        surfels = numpy.concatenate(list(self.mapper.parts(3000)))
        self.assertEqual(follower.bytes(), surfels.tobytes())

    def test_a_late_subscriber_gets_the_whole_map(self):
        report = self.map_walk(2)
        follower = Follower(self.mapper)
        self.addCleanup(follower.subscriber.unregister)
        wait_until(lambda: follower.sequence >= report.sequence or follower.faults, 10, 'the whole map')
        self.assertEqual(follower.faults, [])
        self.assertEqual(len(follower.surfels), report.surfels)
        self.assertGreater(follower.most_parts, 2)

    def test_get_surfels_refuses_with_the_ways_out(self):
        self.map_walk(1)
        with self.assertRaisesRegex(rospy.ServiceException, 'surfels are more than a message may have.*smaller boxes.*~update'):
            self.mapper.surfels()

    def test_get_surfels_in_parts(self):
        report = self.map_walk(2)
        for most, largest in ((3000, 3000), (20000, 5000)):
            parts = list(self.mapper.parts(most))
            self.assertEqual({len(part) for part in parts[:-1]}, {largest})
            ids = numpy.concatenate(parts)['id']
            self.assertEqual(len(ids), report.surfels)
            self.assertTrue((numpy.diff(ids.astype(int)) > 0).all())

    def test_a_cloud_that_is_too_large_is_told(self):
        self.map_walk(1)
        told = []
        log = rospy.Subscriber('/rosout', Log, lambda entry: told.append(entry.msg))
        self.addCleanup(log.unregister)
        wait_until(log.get_num_connections, what='/rosout')
        cloud = rospy.Subscriber('mapper/surfels', PointCloud2)
        self.addCleanup(cloud.unregister)
        wait_until(lambda: [text for text in told if 'mapper/surfels' in text and '~get_surfels' in text], what='the warning')


if __name__ == '__main__':
    run('test_parts', InParts)
