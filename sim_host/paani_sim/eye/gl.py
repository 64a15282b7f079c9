"""The OpenGL context of the eye and the few buffers it needs. The only importer of OpenGL.

A context belongs to the thread that made it current: make, use and close it in one thread.
"""

import ctypes
import os
from collections.abc import Sequence
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

from paani.errors import UserError

MISSING_GL = "eye: no off-screen OpenGL (install the Debian packages libegl1 libopengl0 libgl1-mesa-dri)"


class Context:
    """One off-screen EGL context, current in the calling thread until `close`.

    The software rasteriser draws in the calling thread: the same pixels as with threads of its own, in an eighth less
    time, and nothing of it runs beside the caller. Raises `UserError` where the GL libraries are missing.
    """

    def __init__(self) -> None:
        os.environ.setdefault("LP_NUM_THREADS", "0")
        try:
            from mujoco.egl import GLContext  # noqa: PLC0415 - fails where the libraries are missing
            from OpenGL import GL  # noqa: PLC0415

            self._context: Any = GLContext(16, 16)
            self._context.make_current()
            self.gl: ModuleType = GL
            self.renderer = str(GL.glGetString(GL.GL_RENDERER).decode())
        except (ImportError, AttributeError, OSError, RuntimeError) as error:
            raise UserError(f"{MISSING_GL}: {str(error).splitlines()[0]}") from error

    def make_current(self) -> None:
        """Direct the calling thread's OpenGL calls to this context."""
        self._context.make_current()

    def close(self) -> None:
        """Free the context and everything made in it."""
        self._context.free()


@dataclass(frozen=True)
class Batch:
    """Triangles on the GPU side, drawn with one call."""

    vertex_array: int
    index_count: int
    buffers: tuple[int, int]


@dataclass(frozen=True)
class Target:
    """A frame buffer with a colour picture, perhaps a label picture, and depth."""

    frame: int
    colour: int
    width_px: int
    height_px: int


class Program:
    """A linked shader program with its uniforms by name."""

    def __init__(self, gl: ModuleType, vertex: str, fragment: str) -> None:
        self._gl = gl
        self.handle = gl.glCreateProgram()
        for kind, source in ((gl.GL_VERTEX_SHADER, vertex), (gl.GL_FRAGMENT_SHADER, fragment)):
            shader = gl.glCreateShader(kind)
            gl.glShaderSource(shader, source.strip())
            gl.glCompileShader(shader)
            if not gl.glGetShaderiv(shader, gl.GL_COMPILE_STATUS):
                raise RuntimeError(gl.glGetShaderInfoLog(shader).decode())
            gl.glAttachShader(self.handle, shader)
        gl.glLinkProgram(self.handle)
        if not gl.glGetProgramiv(self.handle, gl.GL_LINK_STATUS):
            raise RuntimeError(gl.glGetProgramInfoLog(self.handle).decode())
        self._places: dict[str, int] = {}

    def use(self, **values: float | npt.NDArray[np.float32]) -> None:
        """Make current and set uniforms: floats, vectors of 2 or 3, and `(4, 4)` matrices."""
        gl = self._gl
        gl.glUseProgram(self.handle)
        for name, value in values.items():
            place = self._places.get(name)
            if place is None:
                place = self._places[name] = gl.glGetUniformLocation(self.handle, name)
            if place < 0:
                continue
            if isinstance(value, int | float):
                gl.glUniform1f(place, value)
            elif value.shape == (4, 4):
                gl.glUniformMatrix4fv(place, 1, gl.GL_TRUE, np.ascontiguousarray(value, np.float32))
            elif value.shape == (3,):
                gl.glUniform3f(place, *value.tolist())
            else:
                gl.glUniform2f(place, *value.tolist())

    def sampler(self, name: str, unit: int) -> None:
        """Bind the sampler to a texture unit."""
        self._gl.glUseProgram(self.handle)
        self._gl.glUniform1i(self._gl.glGetUniformLocation(self.handle, name), unit)


def make_batch(
    gl: ModuleType,
    rows: npt.NDArray[np.float32],
    widths: Sequence[int],
    index: npt.NDArray[np.uint32],
) -> Batch:
    """Upload float rows whose columns split into attributes of the given widths."""
    array = gl.glGenVertexArrays(1)
    gl.glBindVertexArray(array)
    vertex_buffer, index_buffer = gl.glGenBuffers(2)
    data = np.ascontiguousarray(rows, np.float32)
    gl.glBindBuffer(gl.GL_ARRAY_BUFFER, vertex_buffer)
    gl.glBufferData(gl.GL_ARRAY_BUFFER, data.nbytes, data, gl.GL_STATIC_DRAW)
    order = np.ascontiguousarray(index, np.uint32)
    gl.glBindBuffer(gl.GL_ELEMENT_ARRAY_BUFFER, index_buffer)
    gl.glBufferData(gl.GL_ELEMENT_ARRAY_BUFFER, order.nbytes, order, gl.GL_STATIC_DRAW)
    offset = 0
    for place, width in enumerate(widths):
        gl.glEnableVertexAttribArray(place)
        gl.glVertexAttribPointer(place, width, gl.GL_FLOAT, False, 4 * data.shape[1], ctypes.c_void_p(4 * offset))
        offset += width
    gl.glBindVertexArray(0)
    return Batch(int(array), order.size, (int(vertex_buffer), int(index_buffer)))


def drop_batch(gl: ModuleType, batch: Batch) -> None:
    """Give a batch's memory back."""
    gl.glDeleteVertexArrays(1, [batch.vertex_array])
    gl.glDeleteBuffers(2, list(batch.buffers))


def draw(gl: ModuleType, batch: Batch) -> None:
    """Draw with the current program."""
    gl.glBindVertexArray(batch.vertex_array)
    gl.glDrawElements(gl.GL_TRIANGLES, batch.index_count, gl.GL_UNSIGNED_INT, None)


def draw_chunks(gl: ModuleType, batch: Batch, first: npt.NDArray[np.int64], count: npt.NDArray[np.int64]) -> None:
    """Draw some stretches of a batch's indices, in the given order, with the current program."""
    if len(first) == 0:
        return
    gl.glBindVertexArray(batch.vertex_array)
    offsets = (ctypes.c_void_p * len(first))(*(4 * first).tolist())
    gl.glMultiDrawElements(gl.GL_TRIANGLES, count.astype(np.int32), gl.GL_UNSIGNED_INT, offsets, len(first))


def make_texture(
    gl: ModuleType,
    picture: npt.NDArray[np.uint8],
    unit: int,
    *,
    wrap_u: bool = True,
    wrap_v: bool = True,
    between_levels: bool = True,
) -> int:
    """Upload `(h, w, c)` (or `(layers, h, w, c)`) with mip levels and leave it bound to `unit`.

    Without `between_levels` the nearest level is read: half the cost.
    """
    layered = picture.ndim == 4
    kind = gl.GL_TEXTURE_2D_ARRAY if layered else gl.GL_TEXTURE_2D
    inside, outside = (gl.GL_RGBA8, gl.GL_RGBA) if picture.shape[-1] == 4 else (gl.GL_RGB8, gl.GL_RGB)
    texture = gl.glGenTextures(1)
    gl.glActiveTexture(gl.GL_TEXTURE0 + unit)
    gl.glBindTexture(kind, texture)
    gl.glPixelStorei(gl.GL_UNPACK_ALIGNMENT, 1)
    data = np.ascontiguousarray(picture)
    if layered:
        gl.glTexImage3D(
            kind,
            0,
            inside,
            data.shape[2],
            data.shape[1],
            data.shape[0],
            0,
            outside,
            gl.GL_UNSIGNED_BYTE,
            data,
        )
    else:
        gl.glTexImage2D(kind, 0, inside, data.shape[1], data.shape[0], 0, outside, gl.GL_UNSIGNED_BYTE, data)
    gl.glGenerateMipmap(kind)
    smooth = gl.GL_LINEAR_MIPMAP_LINEAR if between_levels else gl.GL_LINEAR_MIPMAP_NEAREST
    gl.glTexParameteri(kind, gl.GL_TEXTURE_MIN_FILTER, smooth)
    gl.glTexParameteri(kind, gl.GL_TEXTURE_MAG_FILTER, gl.GL_LINEAR)
    for wraps, axis in ((wrap_u, gl.GL_TEXTURE_WRAP_S), (wrap_v, gl.GL_TEXTURE_WRAP_T)):
        if not wraps:
            gl.glTexParameteri(kind, axis, gl.GL_CLAMP_TO_EDGE)
    return int(texture)


def make_target(
    gl: ModuleType, width_px: int, height_px: int, unit: int, *, slots: int = 2, fine: bool = False
) -> Target:
    """A frame buffer whose colour picture stays bound to `unit`; `fine`: it holds half floats, without mip levels."""
    frame = gl.glGenFramebuffers(1)
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, frame)
    inside, number = (gl.GL_RGBA16F, gl.GL_FLOAT) if fine else (gl.GL_RGBA8, gl.GL_UNSIGNED_BYTE)
    pictures = []
    for slot in range(slots):
        texture = gl.glGenTextures(1)
        gl.glActiveTexture(gl.GL_TEXTURE0 + unit + slot)
        gl.glBindTexture(gl.GL_TEXTURE_2D, texture)
        gl.glTexImage2D(gl.GL_TEXTURE_2D, 0, inside, width_px, height_px, 0, gl.GL_RGBA, number, None)
        smooth = gl.GL_LINEAR if fine else gl.GL_LINEAR_MIPMAP_NEAREST if slot == 0 else gl.GL_NEAREST
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MIN_FILTER, smooth)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_MAG_FILTER, gl.GL_LINEAR)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_WRAP_S, gl.GL_CLAMP_TO_EDGE)
        gl.glTexParameteri(gl.GL_TEXTURE_2D, gl.GL_TEXTURE_WRAP_T, gl.GL_CLAMP_TO_EDGE)
        gl.glFramebufferTexture2D(gl.GL_FRAMEBUFFER, gl.GL_COLOR_ATTACHMENT0 + slot, gl.GL_TEXTURE_2D, texture, 0)
        pictures.append(int(texture))
    depth = gl.glGenRenderbuffers(1)
    gl.glBindRenderbuffer(gl.GL_RENDERBUFFER, depth)
    gl.glRenderbufferStorage(gl.GL_RENDERBUFFER, gl.GL_DEPTH_COMPONENT24, width_px, height_px)
    gl.glFramebufferRenderbuffer(gl.GL_FRAMEBUFFER, gl.GL_DEPTH_ATTACHMENT, gl.GL_RENDERBUFFER, depth)
    return Target(int(frame), pictures[0], width_px, height_px)


def begin_target(gl: ModuleType, target: Target, slots: int) -> None:
    """Draw into the first `slots` pictures of a target from now on, cleared."""
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target.frame)
    aim_target(gl, slots)
    gl.glViewport(0, 0, target.width_px, target.height_px)
    gl.glClearColor(0.0, 0.0, 0.0, 0.0)
    gl.glClear(gl.GL_COLOR_BUFFER_BIT | gl.GL_DEPTH_BUFFER_BIT)


def aim_target(gl: ModuleType, slots: int) -> None:
    """Draw into the first `slots` pictures of the current target."""
    gl.glDrawBuffers(2, [gl.GL_COLOR_ATTACHMENT0, gl.GL_COLOR_ATTACHMENT1 if slots > 1 else gl.GL_NONE])


def read_target(gl: ModuleType, target: Target, slot: int) -> npt.NDArray[np.uint8]:
    """Picture `slot` (0 colour as BGRA, 1 label) as `(h, w, 4)` uint8, top row first."""
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target.frame)
    gl.glReadBuffer(gl.GL_COLOR_ATTACHMENT0 + slot)
    data = np.empty((target.height_px, target.width_px, 4), np.uint8)
    order = gl.GL_BGRA if slot == 0 else gl.GL_RGBA
    gl.glReadPixels(0, 0, target.width_px, target.height_px, order, gl.GL_UNSIGNED_BYTE, data)
    return data[::-1]


def read_depth(gl: ModuleType, target: Target) -> npt.NDArray[np.float32]:
    """The depth buffer `(h, w)`, 0 near to 1 far, top row first."""
    gl.glBindFramebuffer(gl.GL_FRAMEBUFFER, target.frame)
    data = np.empty((target.height_px, target.width_px), np.float32)
    gl.glReadPixels(0, 0, target.width_px, target.height_px, gl.GL_DEPTH_COMPONENT, gl.GL_FLOAT, data)
    return data[::-1]
