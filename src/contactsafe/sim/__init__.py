"""The world: scene, whiteboard and ink, camera, obstacles, sensing and plant errors, native stepping."""
