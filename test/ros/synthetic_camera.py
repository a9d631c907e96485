"""Depth images of a room whose geometry is known exactly, and their messages, for the rostests."""
import functools
import io

import numpy
import rospy
from PIL import Image as Picture
from geometry_msgs.msg import TransformStamped
from sensor_msgs.msg import CameraInfo, CompressedImage, Image, RegionOfInterest

ROOM = ((-3.0, -2.5, 0.0), (2.5, 2.5, 2.6))  # two corners; the camera is inside [m]
BOXES = [((0.9, -0.6, 0.0), (1.5, 0.4, 0.9)), ((0.2, 0.7, 0.0), (0.8, 1.3, 1.6)), ((1.6, 0.9, 0.4), (2.2, 1.5, 1.1))]
BACK = 1000


class Camera:
    """A pinhole camera without distortion."""

    def __init__(self, width=320, height=240):
        self.width, self.height = width, height
        self.f, self.cx, self.cy = width * 0.85, (width - 1) / 2, (height - 1) / 2
        self.distortion, self.roi = None, RegionOfInterest()

    def info(self, header):
        """With distortion, it has no P, as of a camera that is not rectified."""
        P = [0] * 12 if self.distortion else [self.f, 0, self.cx, 0, 0, self.f, self.cy, 0, 0, 0, 1, 0]
        return CameraInfo(header=header, width=self.width, height=self.height, distortion_model='plumb_bob', D=self.distortion or [0.0] * 5,
                          K=[self.f, 0, self.cx, 0, self.f, self.cy, 0, 0, 1], R=[1, 0, 0, 0, 1, 0, 0, 0, 1], P=P, roi=self.roi)

    def depth(self, step):
        """The depth image at a step of the walk: millimetres as uint16."""
        return render(self.width, self.height, step)

    def color(self):
        """A colour image without black pixels, in which neighbouring pixels differ."""
        columns, rows = numpy.meshgrid(numpy.arange(self.width), numpy.arange(self.height))
        return numpy.stack([50 + columns % 200, 50 + rows % 200, 200 - columns % 100], axis=-1).astype(numpy.uint8)


@functools.lru_cache(maxsize=100)
def render(width, height, step):
    camera, T_world_camera = Camera(width, height), pose(step)
    columns, rows = numpy.meshgrid(numpy.arange(width), numpy.arange(height))
    rays = numpy.stack([(columns - camera.cx) / camera.f, (rows - camera.cy) / camera.f, numpy.ones_like(columns, dtype=float)], axis=-1)
    rays = rays @ T_world_camera[:3, :3].T
    origin = T_world_camera[:3, 3]
    rays[numpy.abs(rays) < 1e-12] = 1e-12
    z = crossings(ROOM, origin, rays)[1]
    for box in BOXES:
        enters, leaves = crossings(box, origin, rays)
        z = numpy.where((enters < leaves) & (enters > 0), numpy.minimum(z, enters), z)
    return numpy.round(z * 1000).astype(numpy.uint16)


def crossings(box, origin, rays):
    """Depths at which rays enter and leave a box."""
    near, far = (numpy.array(corner) - origin for corner in box)
    low, high = numpy.minimum(near / rays, far / rays), numpy.maximum(near / rays, far / rays)
    return low.max(axis=-1), high.min(axis=-1)


def pose(step):
    """T_world_camera of a hand-held walk through the room, looking along x. From step BACK on it is the same walk, looking back."""
    yaw, pitch = 0.25 * numpy.sin(0.5 * step) + (numpy.pi if step >= BACK else 0), 0.15
    forward = numpy.array([numpy.cos(yaw) * numpy.cos(pitch), numpy.sin(yaw) * numpy.cos(pitch), -numpy.sin(pitch)])
    right = numpy.array([numpy.sin(yaw), -numpy.cos(yaw), 0.0])
    T = numpy.eye(4)
    T[:3, 0], T[:3, 1], T[:3, 2] = right, numpy.cross(forward, right), forward
    T[:3, 3] = -1.2 + 0.04 * (step % BACK), 0.1 * numpy.sin(step), 1.3
    return T


def transform(T_parent_child, parent, child, stamp):
    message = TransformStamped(child_frame_id=child)
    message.header.frame_id, message.header.stamp = parent, stamp
    t, q = message.transform.translation, message.transform.rotation
    t.x, t.y, t.z = T_parent_child[:3, 3]
    R = T_parent_child[:3, :3]
    q.w = numpy.sqrt(max(0.0, 1 + numpy.trace(R))) / 2  # is not 0, because no pose above is a half turn
    q.x, q.y, q.z = ((R[k, j] - R[j, k]) / (4 * q.w) for j, k in ((1, 2), (2, 0), (0, 1)))
    return message


def raw_image(array, encoding, header, big_endian=False, padding=0):
    """An image of the rows of `array`, each of them followed by `padding` bytes that are no pixels."""
    if array.dtype.itemsize > 1:
        array = array.astype(array.dtype.newbyteorder('>' if big_endian else '<'))
    rows = numpy.ascontiguousarray(array).view(numpy.uint8).reshape(len(array), -1)
    rows = numpy.pad(rows, ((0, 0), (0, padding)), constant_values=0x5A)
    return Image(header=header, height=array.shape[0], width=array.shape[1], encoding=encoding, is_bigendian=int(big_endian),
                 step=rows.shape[1], data=rows.tobytes())


def metres(millimetres):
    """Depth in metres, with NaN where there is no measurement (REP 118)."""
    return numpy.where(millimetres == 0, numpy.nan, millimetres.astype(numpy.float32) / numpy.float32(1000)).astype(numpy.float32)


def compressed_depth(millimetres, header):
    """The message that compressed_depth_image_transport makes: 12 bytes, then a PNG."""
    return CompressedImage(header=header, format='16UC1; compressedDepth', data=bytes(12) + png(millimetres))


def png(array):
    stream = io.BytesIO()
    Picture.fromarray(array).save(stream, format='PNG')
    return stream.getvalue()


def header_of(frame, stamp=None):
    header = rospy.Header(frame_id=frame)
    header.stamp = rospy.Time.now() if stamp is None else stamp
    return header
