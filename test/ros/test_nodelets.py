#!/usr/bin/python3
"""Several mappers as nodelets of one manager, which goes on whatever happens to them."""
import threading
import time

import rospy
from frontier_surfels.msg import FrameReport
from nodelet.srv import NodeletList, NodeletLoad, NodeletUnload

from mapper_client import Mapper, MapperTest, run, wait_until

SOURCES = ['depth/image', 'depth/camera_info']
TARGETS = ['camera/depth/image_rect', 'camera/depth/camera_info']


class Nodelets(MapperTest):
    @classmethod
    def setUpClass(cls):
        super().setUpClass()  # `mapper` is a node
        cls.left, cls.right = Mapper('left', 'manager'), Mapper('right', 'manager')  # two nodelets
        for mapper in (cls.left, cls.right):
            mapper.wait_until_connected(*cls.camera.raw())
        cls.load = rospy.ServiceProxy('manager/load_nodelet', NodeletLoad)
        cls.unload = rospy.ServiceProxy('manager/unload_nodelet', NodeletUnload)
        cls.list = rospy.ServiceProxy('manager/list', NodeletList)

    def setUp(self):
        super().setUp()
        for mapper in (self.left, self.right):
            self.assertTrue(mapper.reset().success)

    def load_mapper(self, name, arguments=()):
        """Returns whether it was loaded."""
        try:
            return self.load('/' + name, 'frontier_surfels/mapper', SOURCES, TARGETS, arguments, '').success
        except rospy.ServiceException:
            return False

    def test_nodelets_and_the_node_make_the_same_map(self):
        for step in range(4):
            header = self.camera.send(step)
            for mapper in (self.mapper, self.left, self.right):
                self.check_integrated(header, mapper)
        surfels = self.mapper.surfels()
        self.assert_same_map(surfels, self.left.surfels())
        self.assert_same_map(surfels, self.right.surfels())

    def test_each_has_a_map_of_its_own(self):
        self.left.pause(True)
        self.addCleanup(self.left.pause, False)
        self.check_integrated(self.camera.send(0), self.right)
        self.assertEqual(len(self.left.surfels()), 0)
        self.assertGreater(len(self.right.surfels()), 1000)

    def test_unload_and_reload_under_load(self):
        stop = threading.Event()

        def shoot():
            for step in range(100000):
                if stop.wait(1 / 60):
                    return
                self.camera.send(step % 20)

        shooter = threading.Thread(target=shoot)
        shooter.start()
        self.addCleanup(shooter.join)
        self.addCleanup(stop.set)
        for _ in range(4):
            third = Mapper('third', 'manager')
            self.assertTrue(self.load_mapper('third'))
            wait_until(lambda: any(report.result == FrameReport.INTEGRATED for report in third.reports), what='a frame of the new mapper')
            start = time.monotonic()
            self.assertTrue(self.unload('/third').success)
            self.assertLess(time.monotonic() - start, 2)
            third.subscriber.unregister()
        count = len(self.left.reports)
        wait_until(lambda: len(self.left.reports) > count + 5, what='the other nodelet to go on')
        self.assertEqual(sorted(self.list().nodelets), ['/left', '/right'])

    def test_wrong_parameters_and_arguments_refuse_to_load(self):
        self.assertFalse(self.load_mapper('wrong', ['depth/image=foo']))
        self.assertTrue(self.load_mapper('unbound', ['--no-bond']))  # an option of nodelet's
        self.assertTrue(self.unload('/unbound').success)
        rospy.set_param('/wrong', {'z_max': -1.0, 'decimation': 'many'})
        self.addCleanup(rospy.delete_param, '/wrong')
        self.assertFalse(self.load_mapper('wrong'))
        self.assertEqual(sorted(self.list().nodelets), ['/left', '/right'])
        self.check_integrated(self.camera.send(0), self.left)


if __name__ == '__main__':
    run('test_nodelets', Nodelets)
