    const fit = () => { viewer.camera.zoom = Math.min(1, innerWidth / innerHeight / 1.4); viewer.set_dirty(); };
    addEventListener("resize", fit);
