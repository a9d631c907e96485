#!/usr/bin/python3
"""The camera's pose from tf: late, missing, jumping, static, with slashes in the names of frames. An image is never mapped with a wrong pose."""
import time

import numpy
import rospy
from frontier_surfels.msg import FrameReport
from tf2_msgs.msg import TFMessage

from mapper_client import MapperTest, case, run
from synthetic_camera import header_of, pose, raw_image, transform

NO_POSE = FrameReport.DROPPED_NO_POSE
TF_TIMEOUT = 0.5  # [s], as in poses.test


def shifted(T, *translation):
    result = T.copy()
    result[:3, 3] += translation
    return result


class Poses(MapperTest):
    def image(self, step):
        return raw_image(self.camera.camera.depth(step), '16UC1', None)

    def test_pose_a_little_later_than_its_image(self):
        self.check_integrated(self.camera.send(0))
        header = self.camera.send(1, send_pose=False)
        time.sleep(0.1)
        self.camera.send_pose(pose(1), header.stamp)
        report = self.check_integrated(header)
        self.assertGreater(report.wait_ms, 80)
        self.assertGreater(report.latency_ms, report.wait_ms)
        late = self.mapper.surfels()
        self.mapper.reset()
        self.camera.new_frame()
        self.map_walk(2)
        self.assert_same_but_ids(late, self.mapper.surfels())

    def test_no_pose_at_all(self):
        start = time.monotonic()
        report = self.check_dropped(self.camera.send(0, send_pose=False), NO_POSE, self.camera.frame)
        self.assertLess(time.monotonic() - start, TF_TIMEOUT + 1)
        self.assertEqual((report.surfels, len(self.mapper.surfels())), (0, 0))

    def test_pose_that_stays_behind(self):
        """The newest pose is not used for a later image: nothing is extrapolated."""
        report = self.map_walk(2)
        self.check_dropped(self.camera.send(2, send_pose=False), NO_POSE, 'older than the image')
        self.assertEqual(self.mapper.map()[0], report.sequence)
        self.map_walk(1, first=3)

    def test_missing_link_of_a_chain(self):
        header = header_of(self.camera.frame)
        base = self.camera.frame + '_base'
        self.camera.send_pose(numpy.eye(4), header.stamp, parent=base)
        self.camera.send(0, stamp=header.stamp, send_pose=False)
        self.check_dropped(header, NO_POSE, self.camera.frame)
        header = header_of(self.camera.frame)
        self.camera.send_pose(numpy.eye(4), header.stamp, parent=base)
        self.camera.send_pose(pose(0), header.stamp, child=base)
        self.camera.send(0, stamp=header.stamp, send_pose=False)
        self.check_integrated(header)

    def test_pose_between_two_others_is_interpolated(self):
        """The image was taken halfway between them."""
        ahead, behind = (shifted(pose(0), x, 0, 0) for x in (0.1, -0.1))
        stamp = rospy.Time.now()
        self.camera.send_pose(behind, stamp - rospy.Duration(0.05))
        self.camera.send_pose(ahead, stamp + rospy.Duration(0.05))
        self.check_integrated(self.camera.send(0, stamp=stamp, send_pose=False))
        between = self.mapper.surfels()
        self.mapper.reset()
        self.camera.new_frame()
        self.map_walk(1)
        exact = self.mapper.surfels()
        self.assertLess(abs(len(between) - len(exact)), 0.02 * len(exact))
        for axis in 'xyz':
            self.assertAlmostEqual(between[axis].mean(), exact[axis].mean(), delta=0.01)

    def test_pose_that_jumps(self):
        """As after a loop closure: every image is mapped with the pose of its own time."""
        self.check_integrated(self.camera.send(0))
        T_jumped = shifted(pose(1), 30, 0, 0)
        header = header_of(self.camera.frame)
        self.camera.send_pose(T_jumped, header.stamp)
        self.camera.send(1, stamp=header.stamp, send_pose=False)
        self.check_integrated(header)
        self.check_integrated(self.camera.send(2))
        x = self.mapper.surfels()['x']
        self.assertGreater(((x > -4) & (x < 4)).sum(), 1000)
        self.assertGreater(((x > 26) & (x < 34)).sum(), 1000)
        self.assertEqual(((x > 4) & (x < 26)).sum(), 0)

    def test_frames_with_leading_slashes(self):
        header = self.camera.send(0)
        self.check_integrated(header)
        plain = self.mapper.surfels()
        self.mapper.reset()
        self.camera.new_frame()
        name, self.camera.world = self.camera.frame, '/map'
        self.addCleanup(setattr, self.camera, 'world', 'map')
        for frame in ('/' + name, name):
            self.camera.frame = frame
            self.check_integrated(self.camera.send(0))
        self.assert_same_but_ids(plain, self.mapper.surfels())

    def test_static_transforms_alone(self):
        static = transform(pose(0), 'map', self.camera.frame, rospy.Time.now() - rospy.Duration(100))
        self.camera.tf_static.publish(TFMessage([static]))
        report = self.check_integrated(self.camera.send(0, send_pose=False))
        self.check_integrated(self.camera.send(0, send_pose=False))
        self.assertLess(report.wait_ms, 1000 * TF_TIMEOUT)
        self.assertGreater(report.surfels, 1000)

    def test_poses_that_are_none(self):
        for name, spoil in {'zero': lambda T: setattr(T.transform.rotation, 'w', 0.0) or setattr(T.transform.rotation, 'x', 0.0) or
                                    setattr(T.transform.rotation, 'y', 0.0) or setattr(T.transform.rotation, 'z', 0.0),
                            'NaN': lambda T: setattr(T.transform.translation, 'x', float('nan')),
                            'infinite': lambda T: setattr(T.transform.translation, 'z', float('inf'))}.items():
            with case(name):
                self.camera.new_frame()
                header = header_of(self.camera.frame)
                bad = transform(pose(0), 'map', self.camera.frame, header.stamp)
                spoil(bad)
                self.camera.tf.publish(TFMessage([bad]))
                self.camera.send(0, stamp=header.stamp, send_pose=False)
                report = self.mapper.report(header)
                self.assertIn(report.result, (NO_POSE, FrameReport.DROPPED_BAD_IMAGE), report.reason)
        self.assertEqual(len(self.mapper.surfels()), 0)

    def test_images_that_do_not_say_where_or_when(self):
        """Images in the world frame itself, without a frame and without a stamp: the identity is not taken for a pose."""
        self.map_walk(1)
        before = self.mapper.surfels()
        for frame in ('map', '/map', ''):
            with case(frame):
                header = header_of(frame)
                self.camera.info.publish(self.camera.camera.info(header))
                image = self.image(0)
                image.header = header
                self.camera.depth.publish(image)
                self.check_dropped(header, NO_POSE, '.')
        self.check_dropped(self.camera.send(1, stamp=rospy.Time(0)), NO_POSE, 'stamp')
        self.assert_same_map(before, self.mapper.surfels())
        self.map_walk(1, first=1)


if __name__ == '__main__':
    run('test_poses', Poses)
