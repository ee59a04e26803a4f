"""Rotations as quaternions: x, y, z, w in a row for each, of length 1."""

import numpy as np

_CLOSE = 0.9995  # cosine above which a straight line is as good as an arc


def unit(turns: np.ndarray) -> np.ndarray:
    """Return them with length 1; of length 0: no rotation."""
    length = np.linalg.norm(turns, axis=1, keepdims=True)
    return np.where(length > 0, turns / np.where(length > 0, length, 1.0), (0.0, 0.0, 0.0, 1.0))


def times(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the rotations `second`, then `first`."""
    a, b = first[:, :3], second[:, :3]
    w, v = first[:, 3:], second[:, 3:]
    return np.hstack([w * b + v * a + np.cross(a, b), w * v - np.sum(a * b, axis=1, keepdims=True)])


def rotated(turns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Return vectors, rotated."""
    return (matrices(turns) @ vectors[:, :, None])[:, :, 0]


def matrices(turns: np.ndarray) -> np.ndarray:
    """Return the matrices of rotations."""
    x, y, z, w = unit(turns).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def of_matrices(matrix: np.ndarray) -> np.ndarray:
    """Return the quaternions of matrices, without jumps between neighbours."""
    m = matrix
    # each component squared, times 4; the greatest is divided by
    squares = np.stack(
        [
            1 + m[:, 0, 0] - m[:, 1, 1] - m[:, 2, 2],
            1 - m[:, 0, 0] + m[:, 1, 1] - m[:, 2, 2],
            1 - m[:, 0, 0] - m[:, 1, 1] + m[:, 2, 2],
            1 + m[:, 0, 0] + m[:, 1, 1] + m[:, 2, 2],
        ],
        axis=1,
    )
    products = np.zeros((len(m), 4, 4))
    products[:, range(4), range(4)] = squares
    for i, j in ((0, 1), (0, 2), (1, 2)):
        products[:, i, j] = products[:, j, i] = m[:, i, j] + m[:, j, i]
    for i, (row, column) in enumerate(((2, 1), (0, 2), (1, 0))):
        products[:, i, 3] = products[:, 3, i] = m[:, row, column] - m[:, column, row]
    best = squares.argmax(axis=1)
    found = unit(products[range(len(m)), best])
    flips = np.sum(found[1:] * found[:-1], axis=1) < 0
    signs = np.where(np.concatenate([[0], np.cumsum(flips)]) % 2, -1.0, 1.0)
    return found * signs[:, None]


def slerp(before: np.ndarray, after: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Return the rotations a part `t` of the way along the shorter arc."""
    before, after = unit(before), unit(after)
    cosine = np.sum(before * after, axis=1, keepdims=True)
    after = np.where(cosine < 0, -after, after)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.where(angle > 0, np.sin(angle), 1.0)
    close = np.abs(cosine) > _CLOSE
    first = np.where(close, 1 - t, np.sin((1 - t) * angle) / sine)
    second = np.where(close, t, np.sin(t * angle) / sine)
    return unit(first * before + second * after)
