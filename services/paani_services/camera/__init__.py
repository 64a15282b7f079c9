"""Camera: pictures of the simulator, a webcam or a recording, published on the bus."""
