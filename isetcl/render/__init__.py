"""From scene and eye to the retinal image: plan, samples, the render loop, progress."""
