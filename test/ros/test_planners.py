#!/usr/bin/python3
"""What planners ask and follow: states, rays, views, the grid of states, clusters, the octree and the projected map."""
import os
import shutil
import struct
import tempfile

import numpy
import rospy
from frontier_surfels.msg import FrontierClusterArray, StatesUpdate
from frontier_surfels.srv import (CastRays, CastRaysRequest, EvaluateViews, EvaluateViewsRequest, GetStateGrid, GetStates, GetStatesRequest,
                                  MapFile)
from geometry_msgs.msg import Point, Pose, Vector3
from nav_msgs.msg import OccupancyGrid
from visualization_msgs.msg import MarkerArray

from mapper_client import Mapper, MapperTest, case, run, wait_until
from synthetic_camera import pose, transform

UNKNOWN, FREE, OCCUPIED = StatesUpdate.UNKNOWN, StatesUpdate.FREE, StatesUpdate.OCCUPIED
EDGE = 16  # cells along a block
NAN = float('nan')


class Grid:
    """A copy of the grid of states, by the rules of StatesUpdate.msg."""

    def __init__(self):
        self.sequence, self.blocks, self.gaps = 0, {}, 0

    def apply(self, message):
        if message.since != 0 and message.sequence <= self.sequence:
            return
        if message.since > self.sequence:
            self.gaps += 1
            return
        if message.since == 0:
            self.blocks = {}
        self.sequence, self.resolution = message.sequence, message.resolution
        begin = 0
        for block, kind in zip(numpy.reshape(message.blocks, (-1, 3)), message.kinds):
            if kind == StatesUpdate.MIXED:
                bits = numpy.unpackbits(numpy.frombuffer(message.cells[begin:begin + 1024], numpy.uint8), bitorder='little')
                cells = bits[:4096] * FREE + bits[4096:] * OCCUPIED
                begin += 1024
            else:
                cells = numpy.full(4096, kind)
            self.blocks[tuple(block)] = cells.reshape(EDGE, EDGE, EDGE)  # z, y, x
        assert begin == len(message.cells)

    def state(self, p):
        cell = numpy.floor(numpy.divide(p, self.resolution)).astype(int)
        cells = self.blocks.get(tuple(cell // EDGE))
        return UNKNOWN if cells is None else cells[tuple(cell[::-1] % EDGE)]

    def centres(self, state):
        """Centres of all cells of a state."""
        return [(EDGE * numpy.array(block) + cell[::-1] + 0.5) * self.resolution
                for block, cells in sorted(self.blocks.items()) for cell in numpy.argwhere(cells == state)]

    def known(self):
        return {block: cells.tolist() for block, cells in self.blocks.items() if cells.any()}


class Octree:
    """An octomap_msgs/Octomap, read from its bytes: a planner's nodes were not built with ours."""

    def __init__(self, message):
        buffer, self.at = message._buff, 4

        def take(form):
            values = struct.unpack_from('<' + form, buffer, self.at)
            self.at += struct.calcsize('<' + form)
            return values[0] if len(values) == 1 else values

        self.stamp = rospy.Time(*take('II'))
        self.frame_id = take(f'{take("I")}s').decode()
        self.binary = take('B')
        self.kind = take(f'{take("I")}s')
        self.resolution = take('d')
        end = take('I') + self.at
        self.free = self.occupied = 0
        self.read_node(take, 16)
        assert self.at == end == len(buffer), (self.at, end)

    def read_node(self, take, height):
        """A node's log-odds, a bit for each of its children, and the children. Leaves stand for 8^height cells."""
        log_odds, children = take('fB')
        for _ in range(bin(children).count('1')):
            self.read_node(take, height - 1)
        if children == 0 and log_odds > 0:
            self.occupied += 8 ** height
        elif children == 0:
            self.free += 8 ** height


class Listener:
    """Keeps the messages of a topic."""

    def __init__(self, test, topic, kind):
        self.messages = []
        self.subscriber = rospy.Subscriber('mapper/' + topic, kind, self.messages.append, queue_size=100)
        test.addCleanup(self.subscriber.unregister)

    def wait(self, sequence):
        """The first message of the map with this number, or of a later one."""
        return wait_until(lambda: next((m for m in self.messages if m.sequence >= sequence), None), what='a message of planners')


def points(array):
    return [Point(*map(float, p)) for p in array]


class Planners(MapperTest):
    def ask(self, service, kind, request):
        return self.mapper.call(service, kind, request)

    def check_refused(self, service, kind, request, *words):
        before = self.mapper.map()[0]
        with self.assertRaises(rospy.ServiceException) as fault:
            self.ask(service, kind, request)
        for word in words:
            self.assertIn(word, str(fault.exception))
        self.assertEqual(self.mapper.map()[0], before)

    def camera_pose(self, step=0):
        return numpy.asarray(pose(step), float)

    def ahead(self, distance, step=0):
        """A point in the middle of the view."""
        T = self.camera_pose(step)
        return T[:3, 3] + distance * T[:3, 2]

    def to_pose(self, T):
        both = transform(T, 'map', 'view', rospy.Time()).transform
        return Pose(position=Point(both.translation.x, both.translation.y, both.translation.z), orientation=both.rotation)

    def test_states_and_rays(self):
        self.map_walk(3)
        free, behind = self.ahead(0.4), self.ahead(-2)
        answer = self.ask('get_states', GetStates, GetStatesRequest(points=points([free, behind]), reach=1.0))
        self.assertEqual(list(answer.states), [FREE, UNKNOWN])
        self.assertGreater(answer.clearance[0], 0)
        self.assertEqual(answer.clearance[1], 0)
        surfels = self.mapper.surfels()
        wall = surfels[surfels['label'] == 1][0]
        at = numpy.array([wall['x'], wall['y'], wall['z']], float)
        answer = self.ask('get_states', GetStates, GetStatesRequest(points=points([at]), reach=0.5))
        self.assertEqual(list(answer.states), [OCCUPIED])
        self.assertLess(answer.distances[0], 1e-6)
        self.assertFalse(answer.frontier[0])
        box = self.ask('get_states', GetStates, GetStatesRequest(points=points([at, behind]), box_size=Vector3(0.1, 0.1, 0.1)))
        self.assertEqual(list(box.states), [OCCUPIED, UNKNOWN])
        eye = self.camera_pose()[:3, 3]
        target = at + (at - eye) * 0.2
        rays = self.ask('cast_rays', CastRays, self.rays([free, behind], [target, behind]))
        self.assertEqual(len(rays.states), 2)
        self.assertEqual(rays.states[1], UNKNOWN)
        self.assertEqual(rays.distances[1], 0)
        self.assertEqual(rays.sequence, self.mapper.map()[0])

    def rays(self, starts, ends, **options):
        return CastRaysRequest(starts=points(starts), ends=points(ends), stop_at_unknown=True, **options)

    def test_questions_without_sense(self):
        self.map_walk(1)
        nan = points([(NAN, 0, 0)])
        self.check_refused('get_states', GetStates, GetStatesRequest(), 'points')
        self.check_refused('get_states', GetStates, GetStatesRequest(points=nan), 'finite')
        self.check_refused('get_states', GetStates, GetStatesRequest(points=points([(0, 0, 0)]), reach=NAN), 'reach')
        self.check_refused('cast_rays', CastRays, self.rays([], []), 'starts')
        self.check_refused('cast_rays', CastRays, self.rays([(0, 0, 0)], []), 'ends')
        self.check_refused('cast_rays', CastRays, self.rays([(0, 0, 0)], [(NAN, 0, 0)]), 'finite')
        self.check_refused('cast_rays', CastRays, self.rays([(0, 0, 0)], [(1, 0, 0)], step=1e-9), 'step')
        good = dict(poses=[self.to_pose(numpy.eye(4))], fx=100, fy=100, cx=79.5, cy=59.5, width=160, height=120, range=3)
        for change, word in [(dict(poses=[]), 'poses'), (dict(width=0), 'width'), (dict(height=1000000), '1000000'), (dict(fx=0), 'fx'),
                             (dict(range=-1), 'range'), (dict(poses=[Pose()]), 'quaternion'), (dict(fy=NAN), 'fy')]:
            with case(str(change)):
                self.check_refused('evaluate_views', EvaluateViews, EvaluateViewsRequest(**{**good, **change}), word)

    def test_views(self):
        self.map_walk(3)
        T = self.camera_pose()
        back = T.copy()
        back[:3, 3] -= 1.0 * T[:3, 2]
        request = EvaluateViewsRequest(poses=[self.to_pose(T), self.to_pose(back)], fx=130, fy=130, cx=79.5, cy=59.5, width=160, height=120, range=3)
        answer = self.ask('evaluate_views', EvaluateViews, request)
        self.assertEqual(answer.sequence, self.mapper.map()[0])
        seen, behind = answer.values
        self.assertGreater(seen.occupied_area, 0.1)
        self.assertGreater(seen.occupied_pixels, 1000)
        self.assertEqual(behind.state, UNKNOWN)
        self.assertEqual(behind.clearance, 0)

    def test_grid_of_states(self):
        listener, grid = Listener(self, 'states_update', StatesUpdate), Grid()
        for step in range(4):
            report = self.map_walk(1, first=step)
            listener.wait(report.sequence)
        for message in listener.messages:
            grid.apply(message)
        self.assertEqual(grid.gaps, 0)
        self.assertEqual(listener.messages[-1].header.frame_id, 'map')
        whole = Grid()
        whole.apply(self.mapper.call('get_state_grid', GetStateGrid).grid)
        self.assertEqual(whole.sequence, grid.sequence)
        self.assertEqual(whole.known(), grid.known())
        listener.subscriber.unregister()  # subscribers of one process share a connection
        late = Listener(self, 'states_update', StatesUpdate)
        joined = Grid()
        joined.apply(late.wait(grid.sequence))
        self.assertEqual(joined.known(), grid.known())
        # Free cells are free, by the exact answer.
        free = grid.centres(FREE)
        self.assertGreater(len(free), 200)
        answer = self.ask('get_states', GetStates, GetStatesRequest(points=points(free)))
        self.assertEqual(sum(state == UNKNOWN for state in answer.states), 0)
        self.assertEqual(self.mapper.reset().success, True)
        empty = late.wait(self.mapper.map()[0])
        self.assertEqual((empty.since, len(empty.blocks)), (0, 0))

    def test_clusters(self):
        clusters = Listener(self, 'clusters', FrontierClusterArray)
        markers = []
        subscriber = rospy.Subscriber('mapper/cluster_markers', MarkerArray, markers.append)
        self.addCleanup(subscriber.unregister)
        first = clusters.wait(self.map_walk(2).sequence)
        self.assertGreater(len(first.clusters), 0)
        ids = [cluster.id for cluster in first.clusters]
        self.assertEqual(ids, sorted(set(ids)))
        frontier = self.mapper.surfels()
        frontier = frontier[frontier['label'] == 0]
        self.assertLessEqual(sum(cluster.surfels for cluster in first.clusters), len(frontier))
        for cluster in first.clusters:
            self.assertGreaterEqual(cluster.area, 0.05)
            self.assertTrue(0 < len(cluster.points) == len(cluster.normals) <= 64)
            self.assertLessEqual(len(cluster.viewpoints), 3)
            self.assertLessEqual(cluster.box_min.x, cluster.centroid.x)
            self.assertLessEqual(cluster.centroid.x, cluster.box_max.x)
        wait_until(lambda: markers, what='markers of clusters')
        self.assertEqual({m.ns for m in markers[-1].markers if m.ns} & {'clusters', 'numbers'}, {'clusters', 'numbers'})
        self.assertTrue(self.mapper.reset().success)
        gone = clusters.wait(self.mapper.map()[0])
        self.assertEqual(len(gone.clusters), 0)
        self.assertTrue(set(ids) <= set(sum((list(m.removed) for m in clusters.messages), [])))

    def test_octree_of_a_topic(self):
        if '/mapper/octomap_full' not in dict(rospy.get_published_topics()):
            self.skipTest('~octomap_full is not built, because octomap_msgs was not found')
        states, trees = Listener(self, 'states_update', StatesUpdate), []
        subscriber = rospy.Subscriber('mapper/octomap_full', rospy.AnyMsg, trees.append)
        self.addCleanup(subscriber.unregister)
        grid, stamps = Grid(), set()
        for step in range(3):
            report = self.map_walk(1, first=step)
            states.wait(report.sequence)
            last = wait_until(lambda: next((t for t in map(Octree, trees) if t.stamp >= report.header.stamp), None), what='an octree')
            stamps.add(last.stamp)
        for message in states.messages:
            grid.apply(message)
        self.assertEqual(len(stamps), 3)
        self.assertEqual(trees[-1]._connection_header['type'], 'octomap_msgs/Octomap')
        self.assertEqual(trees[-1]._connection_header['md5sum'], '9a45536b45c5e409cd49f04bb2d9999f')  # of octomap_msgs 0.3
        self.assertEqual((last.frame_id, last.binary, last.kind), ('map', 0, b'OcTree'))
        self.assertAlmostEqual(last.resolution, grid.resolution)
        self.assertEqual(last.free, len(grid.centres(FREE)))
        self.assertEqual(last.occupied, len(grid.centres(OCCUPIED)))

    def test_octree_and_projected_map(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        maps = []
        subscriber = rospy.Subscriber('mapper/projected_map', OccupancyGrid, maps.append)
        self.addCleanup(subscriber.unregister)
        self.map_walk(3)
        answer = self.mapper.call('save_octomap', MapFile, os.path.join(folder, 'map.bt'))
        self.assertTrue(answer.success, answer.message)
        with open(os.path.join(folder, 'map.bt'), 'rb') as file:
            self.assertTrue(file.readline().startswith(b'# Octomap OcTree binary file'))
        refused = self.mapper.call('save_octomap', MapFile, os.path.join(folder, 'missing', 'map.bt'))
        self.assertFalse(refused.success)
        self.assertIn('missing', refused.message)
        self.assertEqual(os.listdir(folder), ['map.bt'])
        self.assertFalse(self.mapper.call('save_octomap', MapFile, '').success)
        grid = wait_until(lambda: next((m for m in maps if 0 in m.data and -1 in m.data), None), what='the projected map')
        self.assertEqual(len(grid.data), grid.info.width * grid.info.height)
        self.assertEqual(grid.header.frame_id, 'map')


if __name__ == '__main__':
    run('test_planners', Planners)
