"""A camera, and the topics and services of a running mapper, so that a case of a rostest is a few lines."""
import contextlib
import itertools
import threading
import time
import unittest

import numpy
import rospy
import rostest
from frontier_surfels.msg import FrameReport
from frontier_surfels.srv import GetSurfels, GetSurfelsRequest, MapFile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_srvs.srv import SetBool, Trigger
from tf2_msgs.msg import TFMessage

from synthetic_camera import Camera, header_of, pose, raw_image, transform

TIMEOUT = 30  # [s] for what takes no time on an idle machine
FORMATS = {6: '<u4', 7: '<f4'}  # of sensor_msgs/PointField
FIELDS = ['x', 'y', 'z', 'normal_x', 'normal_y', 'normal_z', 'label', 'rgb', 'radius', 'confidence', 'curvature', 'id']
NO_COLOR = 1 << 24  # in rgb: the colour is only for show


def wait_until(condition, timeout=TIMEOUT, what='something'):
    """Returns what `condition` returned, once that is true."""
    deadline = time.monotonic() + timeout
    while True:
        result = condition()
        if result:
            return result
        if time.monotonic() > deadline:
            raise AssertionError(f'waited {timeout} s in vain for {what}')
        time.sleep(0.01)


@contextlib.contextmanager
def case(name):
    """Like unittest's subTest, which rostest does not support, except that the first failure ends the test."""
    try:
        yield
    except AssertionError as fault:
        raise AssertionError(f'{name}: {fault}') from fault


def to_array(cloud):
    """A cloud of surfels as a structured array ordered by id, with rgb as a whole number."""
    formats = {field.name: (FORMATS[field.datatype], field.offset) for field in cloud.fields}
    assert sorted(formats) == sorted(FIELDS), formats
    formats['rgb'] = ('<u4', formats['rgb'][1])
    dtype = numpy.dtype({'names': FIELDS, 'formats': [formats[name][0] for name in FIELDS],
                         'offsets': [formats[name][1] for name in FIELDS], 'itemsize': cloud.point_step})
    assert len(cloud.data) == cloud.width * cloud.height * cloud.point_step
    packed = numpy.dtype([(name, formats[name][0]) for name in FIELDS])
    surfels = numpy.frombuffer(cloud.data, dtype=dtype).astype(packed)
    return numpy.sort(surfels, order='id')


def without_ids(surfels):
    """For comparing maps that must be equal but were made in different ways."""
    return numpy.sort(surfels[FIELDS[:-1]])


def has_color(surfels):
    """For every surfel of an array: whether its colour was seen."""
    return surfels['rgb'] & NO_COLOR == 0


class CameraTopics:
    """Publishes what a depth camera and its localisation publish. Every case uses a new `frame`, because tf remembers the old ones."""

    counter = itertools.count()

    def __init__(self, namespace='camera', world='map'):
        self.world, self.camera = world, Camera()
        self.depth = rospy.Publisher(f'{namespace}/depth/image_rect', Image, queue_size=10)
        self.compressed = rospy.Publisher(f'{namespace}/depth/image_rect/compressedDepth', CompressedImage, queue_size=10)
        self.info = rospy.Publisher(f'{namespace}/depth/camera_info', CameraInfo, queue_size=10)
        self.color = rospy.Publisher(f'{namespace}/color/image', Image, queue_size=10)
        self.tf = rospy.Publisher('/tf', TFMessage, queue_size=100)
        self.tf_static = rospy.Publisher('/tf_static', TFMessage, queue_size=100, latch=True)
        self.new_frame()

    def raw(self):
        """The publishers without which nothing is mapped."""
        return self.depth, self.info, self.tf

    def new_frame(self):
        self.frame = f'camera_{next(self.counter)}'

    def send_pose(self, T_world_camera, stamp, parent=None, child=None):
        self.tf.publish(TFMessage([transform(T_world_camera, parent or self.world, child or self.frame, stamp)]))

    def send(self, step, stamp=None, send_pose=True, message=None, color=None):
        """Sends pose, camera_info, colour and depth image of one step of the walk; `message` replaces the depth image. Returns the header."""
        header = header_of(self.frame, stamp)
        if send_pose:
            self.send_pose(pose(step), header.stamp)
        self.info.publish(self.camera.info(header))
        if color is not None:
            self.color.publish(raw_image(color, 'rgb8', header))
        if message is None:
            message = raw_image(self.camera.depth(step), '16UC1', header)
        message.header = header
        (self.compressed if isinstance(message, CompressedImage) else self.depth).publish(message)
        return header


class Mapper:
    """A mapper node, seen through its topics and services."""

    def __init__(self, name='mapper', process=None):
        """`process`: the node that it runs in, if it is a nodelet."""
        self.name, self.process, self.reports, self.changed = name, process or name, [], threading.Condition()
        self.subscriber = rospy.Subscriber(f'{name}/report', FrameReport, self.add_report, queue_size=100)

    def add_report(self, report):
        with self.changed:
            self.reports.append(report)
            self.changed.notify_all()

    def report(self, header, timeout=TIMEOUT):
        """The report on the image with that header."""
        def find():
            return next((report for report in reversed(self.reports)
                         if (report.header.stamp, report.header.frame_id) == (header.stamp, header.frame_id)), None)

        with self.changed:
            assert self.changed.wait_for(find, timeout), f'{self.name} reported nothing on the image of {header.stamp.to_sec():.3f}'
            return find()

    def call(self, service, kind, *arguments):
        rospy.wait_for_service(f'{self.name}/{service}', TIMEOUT)
        return rospy.ServiceProxy(f'{self.name}/{service}', kind)(*arguments)

    def reset(self):
        return self.call('reset', Trigger)

    def pause(self, paused):
        return self.call('pause', SetBool, paused)

    def save(self, path):
        return self.call('save_map', MapFile, str(path))

    def load(self, path):
        return self.call('load_map', MapFile, str(path))

    def map(self, box=((0, 0, 0), (0, 0, 0))):
        """The sequence number of the map, and its surfels."""
        request = GetSurfelsRequest()
        for point, corner in zip((request.box_min, request.box_max), box):
            point.x, point.y, point.z = corner
        response = self.call('get_surfels', GetSurfels, request)
        return response.sequence, to_array(response.surfels)

    def surfels(self):
        return self.map()[1]

    def parts(self, most):
        """The surfels in parts of at most this number."""
        request = GetSurfelsRequest(most=most)
        while True:
            response = self.call('get_surfels', GetSurfels, request)
            yield to_array(response.surfels)
            request.first_id = response.next_id
            if request.first_id == 0:
                return

    def wait_until_connected(self, *publishers):
        """Waits until every publisher is connected to this mapper, and the mapper to this node."""
        wait_until(lambda: self.subscriber.get_num_connections() > 0, what=f'the reports of {self.name}')
        for publisher in publishers:
            wait_until(lambda: '/' + self.process in [connection.endpoint_id for connection in publisher.impl.connections],
                       what=f'{self.name} to listen to {publisher.name}')
        self.map()  # waits until it answers


class MapperTest(unittest.TestCase):
    """Base of cases with one camera and one mapper, whose map is empty when a case begins."""

    @classmethod
    def setUpClass(cls):
        cls.camera, cls.mapper = CameraTopics(), Mapper()
        cls.mapper.wait_until_connected(*cls.camera.raw())

    def setUp(self):
        self.camera.new_frame()
        self.camera.camera = Camera()
        self.assertTrue(self.mapper.reset().success)

    def check_integrated(self, header, mapper=None):
        report = (mapper or self.mapper).report(header)
        self.assertEqual((report.result, report.reason), (FrameReport.INTEGRATED, ''))
        return report

    def check_dropped(self, header, result, reason, mapper=None):
        """The image was dropped for this reason. Returns the report."""
        mapper = mapper or self.mapper
        report = mapper.report(header)
        self.assertEqual(report.result, result, report.reason)
        self.assertRegex(report.reason, reason)
        self.assertRegex(report.reason, r'^[^\n]+\.$')  # it is a sentence
        return report

    def map_walk(self, steps=4, first=0):
        """Maps this number of steps one after the other. Returns the last report."""
        for step in range(first, first + steps):
            report = self.check_integrated(self.camera.send(step))
        return report

    def assert_same_but_ids(self, map_a, map_b):
        self.assertGreater(len(map_a), 1000)
        self.assertEqual(len(map_a), len(map_b))
        different = without_ids(map_a) != without_ids(map_b)
        self.assertEqual(different.sum(), 0, (without_ids(map_a)[different][:2], without_ids(map_b)[different][:2]))

    def assert_same_map(self, map_a, map_b):
        self.assertGreater(len(map_a), 1000)
        self.assertEqual(map_a.tobytes(), map_b.tobytes())


def run(name, case):
    """Runs a rostest."""
    rospy.init_node(name)
    rostest.rosrun('frontier_surfels', name, case)
