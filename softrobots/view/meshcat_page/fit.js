    const fit = () => { viewer.camera.zoom = Math.min(1, innerWidth / innerHeight / (viewer.camera.narrowest ?? 1.4)); viewer.set_dirty(); };
    addEventListener("resize", fit);
    const folding = document.querySelector("#softrobots-legend details"), narrow = innerWidth <= 640;
    folding.open = !narrow;
    folding.firstElementChild.tabIndex = narrow ? 0 : -1;
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1], "+": [0, 0, 1], "=": [0, 0, 1], "-": [0, 0, -1] };
    addEventListener("keydown", event => {
      const { camera, controls, animator } = viewer, step = steps[event.key];
      if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, summary, .dg")) return;
      if (event.key === " ") {
        animator.playing ? animator.pause() : animator.duration > 0 && animator.play();
      } else if (step) {
        const away = new MeshCat.THREE.Spherical().setFromVector3(camera.position.clone().sub(controls.target));
        away.theta += 0.1 * step[0];
        away.phi += 0.1 * step[1];
        away.radius *= 0.9 ** (step[2] ?? 0);
        camera.position.setFromSpherical(away.makeSafe()).add(controls.target);
        controls.update();
        viewer.set_dirty();
      } else return;
      event.preventDefault();
    });
