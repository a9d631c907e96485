"""Pictures of surfels: draws discs into a z-buffer, with numpy alone."""
import collections

import numpy

OCCUPIED = (0.80, 0.78, 0.74)  # of occupied surfels without a colour
FRONTIER = (0.25, 0.50, 0.88)
ERROR = (1.00, 0.00, 1.00)  # magenta: no scene has it
PATH = (1.00, 0.60, 0.05)

SIZE = (900, 600)  # [pixel] width and height of the report's pictures
LARGEST_SPLAT = 24  # [pixel] radius
MOST_PIXELS = 3e7  # maximum sum of the pixels of all splats for which a picture is drawn at twice its size and averaged

TYPES = {'char': 'i1', 'uchar': 'u1', 'short': '<i2', 'ushort': '<u2', 'int': '<i4', 'uint': '<u4', 'float': '<f4', 'double': '<f8'}

# rotation: from the world to the optical frame; focal: focal length in widths of the picture
Camera = collections.namedtuple('Camera', 'rotation position focal')
# Arrays of n rows: position [m], normal, radius [m], color (0 to 1), and two_sided: whether the back is drawn as well
Splats = collections.namedtuple('Splats', 'position normal radius color two_sided')


def read_ply(path):
    """The vertices of a binary little endian PLY file as a structured array."""
    with open(path, 'rb') as file:
        fields, count, element = [], 0, ''
        for line in iter(file.readline, b''):
            words = line.decode('ascii', 'replace').split()
            if words[:1] == ['element']:
                element = words[1]
                count = int(words[2]) if element == 'vertex' else count
            elif words[:1] == ['property'] and element == 'vertex':  # what follows the vertices may be what has been seen
                fields.append((words[2], TYPES[words[1]]))
            elif words == ['end_header']:
                break
        vertices = numpy.fromfile(file, dtype=fields, count=count)
    if len(vertices) != count:
        raise ValueError(f"'{path}' is truncated: {len(vertices)} of {count} surfels.")
    return vertices


def columns(vertices, names):
    return numpy.stack([vertices[name] for name in names], axis=1).astype(numpy.float32)


def splats_of(vertices, wrong=None):
    """Splats of a map: occupied surfels in their colour or grey, frontier blue, and surfels with a mark in `wrong` magenta."""
    color = columns(vertices, ('red', 'green', 'blue')) / 255
    color[(color == 0).all(axis=1)] = OCCUPIED
    color[vertices['label'] == 0] = FRONTIER
    if wrong is not None:
        color[wrong] = ERROR
    return Splats(columns(vertices, 'xyz'), columns(vertices, ('nx', 'ny', 'nz')), vertices['radius'].astype(numpy.float32), color,
                  numpy.zeros(len(vertices), bool))


def splats_of_path(positions):
    """The path of the camera as a chain of small orange discs."""
    steps = numpy.linspace(positions[:-1], positions[1:], 12, endpoint=False).reshape(-1, 3) if len(positions) > 1 else positions
    n = len(steps)
    return Splats(steps.astype(numpy.float32), numpy.zeros((n, 3), numpy.float32), numpy.full(n, 0.012, numpy.float32),
                  numpy.tile(numpy.float32(PATH), (n, 1)), numpy.ones(n, bool))


def joined(*parts):
    return Splats(*(numpy.concatenate(arrays) for arrays in zip(*parts)))


def rotations_of(quaternions):
    """Rotation matrices of rows qx qy qz qw."""
    x, y, z, w = (quaternions / numpy.linalg.norm(quaternions, axis=1, keepdims=True)).T
    return numpy.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                        2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                        2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], axis=1).reshape(-1, 3, 3)


def outside_camera(rotations, cloud):
    """A camera that sees the whole cloud from above, obliquely and from behind the recording camera."""
    up = -rotations[:, :, 1].mean(axis=0)  # which way is up in the world is not known, but a camera is hardly ever held upside down
    up /= numpy.linalg.norm(up) or 1
    forward = rotations[:, :, 2].mean(axis=0)
    forward -= up * (up @ forward)
    if numpy.linalg.norm(forward) < 0.05:  # the camera looked all around or straight down: any direction will do
        forward = numpy.cross(up, numpy.eye(3)[numpy.argmin(abs(up))])
    forward /= numpy.linalg.norm(forward)
    return framing(cloud, 0.62 * forward - 0.38 * numpy.cross(forward, up) - 0.68 * up, up, focal=1.1)


def framing(cloud, direction, up, focal, size=SIZE):
    """A camera that looks along `direction` from where the cloud, except for stray points, fills the picture."""
    z = direction / numpy.linalg.norm(direction)
    x = numpy.cross(z, up)
    x /= numpy.linalg.norm(x)
    rotation = numpy.stack([x, numpy.cross(z, x), z])
    p = cloud @ rotation.T
    low, high = numpy.percentile(p, [0.2, 99.8], axis=0)
    centre = (low + high) / 2
    p = p[((p >= low) & (p <= high)).all(axis=1)] - centre
    half = 0.47 * numpy.array([1, size[1] / size[0]])  # of the picture, in its widths
    distance = (focal * abs(p[:, :2]) / half - p[:, 2:]).max() if len(p) else 1
    return Camera(rotation, rotation.T @ (centre - [0, 0, distance]), focal)


def inside_camera(positions, rotations):
    """The view of the recording camera in the middle of the recording, from a little further back."""
    middle = len(positions) // 2
    rotation = rotations[middle].T
    return Camera(rotation, positions[middle] - 0.25 * rotation[2], focal=0.72)


def render(splats, camera, size=SIZE):
    """A picture[height][width][3] of the splats that face the camera. Walls that turn their back to it do not hide what is behind them."""
    picture = render_at(2, splats, camera, size)
    return picture if picture is not None else render_at(1, splats, camera, size)


def render_at(supersampling, splats, camera, size):
    """Like render(); each pixel is the mean of supersampling^2. None if that would take too long."""
    width, height = (supersampling * n for n in size)
    f = camera.focal * width
    to_surfel = splats.position - camera.position.astype(numpy.float32)
    p = to_surfel @ camera.rotation.T.astype(numpy.float32)
    facing = splats.two_sided | ((to_surfel * splats.normal).sum(axis=1) < 0)
    with numpy.errstate(divide='ignore', invalid='ignore', over='ignore'):
        u, v, radius = f * p[:, 0] / p[:, 2] + width / 2, f * p[:, 1] / p[:, 2] + height / 2, f * splats.radius / p[:, 2]
        order = numpy.flatnonzero((p[:, 2] > 0.05) & facing & (abs(u - width / 2) < width / 2) & (abs(v - height / 2) < height / 2))
    order = order[numpy.argsort(-p[order, 2], kind='stable')]  # far to near
    radius = numpy.clip(radius[order], 0.8, LARGEST_SPLAT)
    if supersampling > 1 and 3 * (radius ** 2).sum() > MOST_PIXELS:
        return None
    flattening = flattenings(to_surfel[order], splats.normal[order], camera)

    nearest = numpy.full(width * height, -1, numpy.int32)
    for part in numpy.array_split(numpy.arange(len(order)), len(order) // 50000 + 1):
        pixel, owner = covered_pixels(u[order[part]], v[order[part]], radius[part], flattening[part], width, height)
        nearest[pixel] = order[part][owner]  # where pixels repeat, numpy keeps the last value, which is the nearest splat
    picture = shaded(nearest.reshape(height, width), splats, p[:, 2], camera)
    s = supersampling
    return picture.reshape(height // s, s, width // s, s, 3).mean(axis=(1, 3))


def flattenings(to_surfel, normal, camera):
    """A vector e for each disc: seen at an angle, the disc is the ellipse |d|^2 + (d.e)^2 <= radius^2 of pixel offsets d."""
    cosine = abs((to_surfel * normal).sum(axis=1)) / numpy.linalg.norm(to_surfel, axis=1)
    cosine = cosine.clip(0.5, 1)  # normals are not exact: thinner ellipses would leave gaps between neighbours
    across = normal @ camera.rotation[:2].T.astype(numpy.float32)
    across /= numpy.maximum(numpy.linalg.norm(across, axis=1, keepdims=True), 1e-6)
    return across * numpy.sqrt(1 / cosine ** 2 - 1)[:, None]


def covered_pixels(u, v, radius, flattening, width, height):
    """The pixels under the discs around (u, v), disc by disc, and the index of the disc of each pixel."""
    square = numpy.mgrid[-LARGEST_SPLAT:LARGEST_SPLAT + 1, -LARGEST_SPLAT:LARGEST_SPLAT + 1].reshape(2, -1)
    distance = numpy.hypot(*square)
    square = square[:, numpy.argsort(distance, kind='stable')].astype(numpy.int32)  # the pixels of a smaller disc come first in those of a larger one
    area = numpy.searchsorted(numpy.sort(distance), radius, side='right')

    owner = numpy.repeat(numpy.arange(len(radius), dtype=numpy.int32), area)
    which = numpy.arange(len(owner), dtype=numpy.int32) - numpy.repeat((numpy.cumsum(area) - area).astype(numpy.int32), area)
    dy, dx = square[0, which], square[1, which]
    across = dx * flattening[:, 0].astype(numpy.float32)[owner] + dy * flattening[:, 1].astype(numpy.float32)[owner]
    x, y = numpy.rint(u).astype(numpy.int32)[owner] + dx, numpy.rint(v).astype(numpy.int32)[owner] + dy
    inside = (dx * dx + dy * dy + across ** 2 <= (radius ** 2)[owner]) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return (y * width + x)[inside], owner[inside]


def shaded(nearest, splats, depth, camera):
    """The picture for nearest[height][width] (the index of a splat, or -1), lit from the camera and shaded behind rims."""
    picture = numpy.ones(nearest.shape + (3,), numpy.float32)
    drawn = nearest >= 0
    index = nearest[drawn]
    to_camera = camera.position - splats.position[index]
    cosine = abs((to_camera * splats.normal[index]).sum(axis=1)) / numpy.linalg.norm(to_camera, axis=1)
    cosine[splats.two_sided[index]] = 1
    log_depth = numpy.full(nearest.shape, 5, numpy.float32)
    log_depth[drawn] = numpy.log(depth[index])
    picture[drawn] = splats.color[index] * (0.45 + 0.55 * cosine)[:, None] * rim_shade(log_depth)[drawn][:, None]
    return picture


def rim_shade(log_depth):
    """Eye-dome lighting: a pixel is darker if its neighbours are nearer to the camera."""
    hidden = numpy.zeros_like(log_depth)
    for axis in (0, 1):
        for shift in (-3, 3):
            hidden += numpy.clip(log_depth - numpy.roll(log_depth, shift, axis), 0, 0.15)
    return numpy.exp(-2 * hidden)
