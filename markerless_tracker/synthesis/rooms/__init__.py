"""Generated rooms: floor and walls with textures, lamps with soft shadows, cameras' sensors.

`spec` samples them, `surfaces` paints them, `lighting` computes each lamp's light on surfaces,
`view` makes one camera's images.
"""

from markerless_tracker.synthesis.rooms.spec import (
    CameraSpec,
    LampSpec,
    RoomSpec,
    SensorSpec,
    SurfaceSpec,
)

__all__ = ["CameraSpec", "LampSpec", "RoomSpec", "SensorSpec", "SurfaceSpec"]
