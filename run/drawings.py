"""Lines, plots and geometry of run/drawings. Points are complex numbers with y upwards."""

import cmath
import math
import random
import re

INK, BLUE, ORANGE, GREY = "#1F2933", "#1D5A8E", "#DD8A33", "#AEB7C0"


def marked(words):
    """Text in which an underscore after a single letter begins an index."""
    words = words.replace("&", "&amp;").replace("<", "&lt;")
    index = r'\1<tspan dy="4" font-size="10">\2</tspan><tspan dy="-4">\3</tspan>'
    return re.sub(r"\b(\w)_(\w)(.?)", index, words).replace('<tspan dy="-4"></tspan>', "")


class Picture:
    def __init__(self, height, width=700):
        self.size, self.parts = (width, height), []

    def panel(self, zero, scale, scale_y=None):
        """Where 0 lies [pixels from the upper left corner], and the pixels of a unit."""
        return Panel(self, zero, scale, scale_y or scale)

    def plot(self, corner, size, x, y, names, ticks=({}, {})):
        """Axes over ranges `x` and `y`; `corner` is the lower left one. Ticks are texts by their value."""
        (left, low), (width, height) = corner, size
        scale, scale_y = width / (x[1] - x[0]), height / (y[1] - y[0])
        panel = self.panel((left - x[0] * scale, low + y[0] * scale_y), scale, scale_y)
        start = complex(x[0], y[0])
        panel.arrow(start, start + x[1] - x[0] + 12 / scale, GREY)
        panel.arrow(start, start + 1j * (y[1] - y[0] + 12 / scale_y), GREY)
        panel.text(complex(x[1], y[0]), names[0], 14, 17 if not ticks[0] else 34, "end")
        panel.text(complex(x[0], y[1]), names[1], 9, -8, "start")
        for value, words in ticks[0].items():
            panel.line([complex(value, y[0]), complex(value, y[0]) - 4j / scale_y], GREY)
            panel.text(complex(value, y[0]), words, 0, 18)
        for value, words in ticks[1].items():
            panel.line([complex(x[0], value), complex(x[0], value) - 4 / scale], GREY)
            panel.text(complex(x[0], value), words, -8, 4, "end")
        return panel

    def svg(self):
        width, height = self.size
        head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
        head += f'viewBox="0 0 {width} {height}" font-family="sans-serif" font-size="13">\n'
        head += "<style>text{stroke:#fff;stroke-width:3px;paint-order:stroke;stroke-linejoin:round}</style>\n"
        head += f'<rect width="{width}" height="{height}" fill="#fff"/>\n'
        return head + "\n".join(self.parts) + "\n</svg>\n"


class Panel:
    def __init__(self, picture, zero, scale, scale_y):
        self.picture, self.zero, self.scale, self.scale_y = picture, complex(*zero), scale, scale_y

    def px(self, p):
        p = complex(p)
        return self.zero + complex(p.real * self.scale, -p.imag * self.scale_y)

    def add(self, part):
        self.picture.parts.append(part)

    def line(self, points, colour=INK, width=1.5, dash="", fill=None, opacity=0.2, closed=False):
        path = " ".join(f"{round(p.real, 1):g},{round(p.imag, 1):g}" for p in map(self.px, points))
        kind = "polygon" if closed or fill else "polyline"
        paint = f'fill="{fill}" fill-opacity="{opacity}"' if fill else 'fill="none"'
        dash = f' stroke-dasharray="{dash}"' if dash else ""
        self.add(f'<{kind} points="{path}" {paint} stroke="{colour}" stroke-width="{width}"{dash}/>')

    def arrow(self, start, end, colour=INK, width=1.5, both=False, dash=""):
        tip, tail = self.px(end), self.px(start)
        along = (tip - tail) / abs(tip - tail)
        self.line([start, end], colour, width, dash)
        for at, out in [(tip, along), (tail, -along)][: 2 if both else 1]:
            head = [at, at - out * (8 + 3j), at - out * (8 - 3j)]
            path = " ".join(f"{p.real:.1f},{p.imag:.1f}" for p in head)
            self.add(f'<polygon points="{path}" fill="{colour}"/>')

    def dot(self, p, colour=INK, radius=3.0, fill=None, width=1):
        at, fill = self.px(p), colour if fill is None else fill
        place = f'cx="{at.real:.1f}" cy="{at.imag:.1f}" r="{radius:.1f}"'
        self.add(f'<circle {place} fill="{fill}" stroke="{colour}" stroke-width="{width}"/>')

    def text(self, p, words, dx=0.0, dy=0.0, anchor="middle", colour=INK):
        at = self.px(p) + complex(dx, dy)
        place = f'x="{at.real:.1f}" y="{at.imag:.1f}" text-anchor="{anchor}"'
        self.add(f'<text {place} fill="{colour}">{marked(words)}</text>')

    def solid(self, surface, depth):
        """A surface with the solid below it."""
        below = [complex(surface[k].real, -depth) for k in (-1, 0)]
        self.line(surface + below, "none", 0, fill=GREY, opacity=0.4)
        self.line(surface, INK, 2)

    def box(self, centre, width, height, words, colour):
        at = self.px(centre) - complex(width, height) / 2
        place = f'x="{at.real:.1f}" y="{at.imag:.1f}" width="{width}" height="{height}" rx="4"'
        self.add(f'<rect {place} fill="{colour}" fill-opacity="0.2" stroke="{colour}" stroke-width="1.5"/>')
        self.text(centre, words, 0, 4)


def unit(degrees):
    return cmath.rect(1.0, math.radians(degrees))


def dot(a, b):
    return (a.conjugate() * b).real


def curve(function, low, high, count=60):
    return [function(low + (high - low) * k / count) for k in range(count + 1)]


def graph(function, low, high, count=60):
    return curve(lambda x: complex(x, function(x)), low, high, count)


def root(function, low, high):
    """Place where a rising function is 0."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if function(middle) > 0.0 else (middle, high)
    return low


def least(function, low, high):
    """Place of the only minimum of a function."""
    for _ in range(100):
        third = (high - low) / 3
        low, high = (low, high - third) if function(low + third) < function(high - third) else (low + third, high)
    return 0.5 * (low + high)


def signed_power(x, exponent):
    return math.copysign(abs(x) ** exponent, x)


def superellipse(a, b, exponent=1.0, count=96):
    """Outline about 0; `a` and `b` are (positive, negative) semi-axes."""
    def point(angle):
        c, s = math.cos(angle), math.sin(angle)
        return complex(a[c < 0] * signed_power(c, exponent), b[s < 0] * signed_power(s, exponent))
    return curve(point, 0.0, 2 * math.pi, count)[:-1]


def farthest(axes, turn, n):
    """Point of a turned ellipse that is farthest along `n`."""
    own, (a, b) = n / turn, axes
    return turn * complex(a * a * own.real, b * b * own.imag) / math.hypot(a * own.real, b * own.imag)


def clipped(polygon, point, normal):
    """Part of a convex polygon behind a line."""
    kept = []
    for p, q in zip(polygon, polygon[1:] + polygon[:1]):
        before, after = dot(normal, p - point), dot(normal, q - point)
        kept += [p] if before <= 0.0 else []
        kept += [p + (q - p) * before / (before - after)] if before * after < 0.0 else []
    return kept


def moments(polygon):
    """Area, centroid and covariances xx, yy, xy."""
    area, first, second = 0.0, 0j, [0.0] * 3
    for p, q in zip(polygon, polygon[1:] + polygon[:1]):
        part = 0.5 * (p.conjugate() * q).imag
        area, first = area + part, first + part * (p + q) / 3
        xs, ys = (p.real, q.real, p.real + q.real), (p.imag, q.imag, p.imag + q.imag)
        for k, (u, v) in enumerate([(xs, xs), (ys, ys), (xs, ys)]):
            second[k] += part / 12 * sum(a * b for a, b in zip(u, v))
    c = first / area
    about = [c.real**2, c.imag**2, c.real * c.imag]
    return area, c, [m / area - of for m, of in zip(second, about)]


def thickness(polygon):
    """D = √(12 / tr C⁻¹) of a body that goes on far across the picture."""
    xx, yy, xy = moments(polygon)[2]
    return math.sqrt(12 * (xx * yy - xy * xy) / (xx + yy))


def cells(points, depth):
    """Lines, each by a point and a normal, around the cell behind each side of a surface."""
    lines = [(q - p) / abs(q - p) for p, q in zip(points, points[1:])]
    for k, line in enumerate(lines):
        planes = [(points[k], 1j * line), (points[k] - 1j * line * depth, -1j * line)]
        planes += [(points[k], -line - lines[k - 1])] if k > 0 else []
        planes += [(points[k + 1], line + lines[k + 1])] if k + 1 < len(lines) else []
        yield planes


def heap(radius, width, surface):
    """Centres of discs that do not touch, below a surface."""
    chance, discs = random.Random(2), []
    for _ in range(20000):
        at = complex(chance.uniform(radius, width - radius), chance.uniform(radius, 4))
        if at.imag < surface(at.real) and all(abs(at - p) > 2 * radius for p in discs):
            discs.append(at)
    return discs


def damping_ratio(restitution, limited):
    """Of linear springs, whose dashpots may attract unless they are limited."""
    def excess(angle):
        if limited:
            return restitution - math.exp(-(math.pi - 2 * angle) * math.tan(angle))
        return restitution - math.exp(-math.pi * math.tan(angle))
    return math.sin(root(excess, 1e-9, 1.5))


def collision(zeta, limited, power):
    """Overlaps and forces of an impact with mass, stiffness and first velocity 1."""
    overlap, speed, dt, path = 0.0, 1.0, 1e-3, []
    while overlap >= 0.0:
        stiffness = power * overlap ** (power - 1)
        dashpot = 2 * zeta * math.sqrt(stiffness * (1 if power == 1 else 5 / 6))
        force = overlap**power + dashpot * speed
        force = max(force, 0.0) if limited else force
        path.append(complex(overlap, force))
        speed -= dt * force
        overlap += dt * speed
    return path[::30] + path[-1:]


def coulomb(turns):
    """Displacements and forces of a spring of stiffness 1 with the limit 1, moved to each of the turns."""
    place, force, path = 0.0, 0.0, [0j]
    for turn in turns:
        reached = math.copysign(1.0, turn - place)
        if abs(turn - place) > abs(reached - force):
            path.append(complex(place + reached - force, reached))
            place, force = turn, reached
        else:
            place, force = turn, force + turn - place
        path.append(complex(place, force))
    return path


def elliptic(m):
    """Complete integrals K and E, by the arithmetic and geometric mean."""
    a, b, power, rest = 1.0, math.sqrt(1 - m), 1.0, 0.5 * m
    while abs(a - b) > 1e-15:
        a, b, half = 0.5 * (a + b), math.sqrt(a * b), 0.5 * (a - b)
        rest, power = rest + power * half * half, 2 * power
    return 0.5 * math.pi / a, 0.5 * math.pi / a * (1 - rest)


def hertz(ratio):
    """Axis ratio of the contact ellipse, F1 and F2 for R'/R'' (Johnson 1985, equations 4.26 to 4.32)."""
    def parts(flatness):
        whole, second = elliptic(1 - flatness**2)
        return second / flatness**2 - whole, whole - second
    flatness = 1.0
    if ratio > 1.0:
        flatness = root(lambda b: ratio - parts(b)[0] / parts(b)[1], 1e-3, 1 - 1e-6)
        above, below = parts(flatness)
        f1 = (4 / math.pi / (1 - flatness**2) * flatness**1.5 * math.sqrt(above * below)) ** (1 / 3)
    else:
        f1 = 1.0
    return flatness, f1, 2 / math.pi * math.sqrt(flatness) / f1 * elliptic(1 - flatness**2)[0]


def jkr(a):
    """Overlap and force for a contact radius, in units in which R*, E* and π w are 1."""
    return complex(a * a - math.sqrt(2 * a), 4 / 3 * a**3 - math.sqrt(8 * a**3))


def rolling_stops(k, damping, duration):
    """Velocity over time, in units in which inertia, first velocity and the limit of the moment are 1."""
    speed, spring, dt, path = 1.0, 0.0, 2e-4, []
    for step in range(round(duration / dt)):
        path.append(complex(step * dt, speed))
        spring = max(-1 / k, min(1 / k, spring + speed * dt))
        speed -= dt * max(-1.0, min(1.0, k * spring + 2 * damping * math.sqrt(k) * speed))
    return path[::100]


def servo_steps(p, steps):
    """Deficits over the steps, against contacts that do not yield."""
    e, s, path = 1.0, 0.0, []
    for step in range(steps + 1):
        path.append(complex(step, e))
        e, s = e - p * e - s, s + p * p / 4 * e
    return path


def verlet(overlap, dt):
    """Overlaps of a ball at each step, on a floor of stiffness 1, with mass and first velocity 1."""
    speed, path = 1.0, [overlap]
    while len(path) < 2 or path[-1] > -0.7:
        speed -= dt * max(path[-1], 0.0)
        path.append(path[-1] + dt * speed)
    return path


def bisected(points, low, high, ranks):
    """Boxes of the ranks with their points; each cut is across the longest side and divides the work by the ranks."""
    if ranks == 1:
        return [(low, high, points)]
    ways = (lambda p: p.real), (lambda p: p.imag)
    across = max(ways, key=lambda way: max(map(way, points)) - min(map(way, points)))
    order, half = sorted(points, key=across), ranks // 2
    count = len(order) * half // ranks
    at = 0.5 * (across(order[count - 1]) + across(order[count]))
    upright = across is ways[0]
    end = complex(at, high.imag) if upright else complex(high.real, at)
    start = complex(at, low.imag) if upright else complex(low.real, at)
    return bisected(order[:count], low, end, half) + bisected(order[count:], start, high, ranks - half)
