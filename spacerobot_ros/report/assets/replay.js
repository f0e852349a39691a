/* A recording in 3D: bodies, wheels and momentum as arrows, the model's prediction as a ghost.
   Reads <script type="application/json"> of every figure.replay (report/replay_view.py). */
'use strict';
(() => {
  const { floats, css, curveColor, chart } = spacerobot;
  const GHOST = 0xd55e00;

  const element = (tag, attributes = {}, ...children) => {
    const out = Object.assign(document.createElement(tag), attributes);
    out.append(...children);
    return out;
  };

  const geometryOf = (shape, detail) => {
    const [a, b, c] = shape.size;
    switch (shape.kind) {
      case 'box': return new THREE.BoxGeometry(a, b, c);
      case 'cylinder': return new THREE.CylinderGeometry(a, a, b, detail).rotateX(Math.PI / 2);
      case 'sphere': return new THREE.SphereGeometry(a, detail, detail);
      case 'ellipsoid': return new THREE.SphereGeometry(1, detail, detail).scale(a, b, c);
      default: {
        const mesh = new THREE.BufferGeometry();
        mesh.setAttribute('position', new THREE.BufferAttribute(floats(shape.triangles), 3));
        mesh.computeVertexNormals();
        return mesh;
      }
    }
  };

  /** Groups of all bodies: each turns about its joint within the place that its parent gives it. */
  function robot(scene, size, material) {
    const root = new THREE.Group(), places = [], moving = scene.bodies.map(() => new THREE.Group());
    scene.bodies.forEach((body, i) => {
      const place = new THREE.Group(), own = moving[i];
      place.position.fromArray(body.position);
      place.quaternion.fromArray(body.quat);
      place.add(own);
      (i ? moving[body.parent] : root).add(place);
      places.push(place);
      body.shapes.forEach((shape) => {
        const mesh = new THREE.Mesh(geometryOf(shape, 24), material(i, shape.color));
        mesh.position.fromArray(shape.position);
        mesh.quaternion.fromArray(shape.quat);
        own.add(mesh);
      });
      const length = Math.hypot(...body.position);
      const isDrawn = i && scene.bodies[body.parent].shapes.some(({ kind }) => kind !== 'ellipsoid');
      if (i && length > 0 && !isDrawn) { // what carries the joint, from its parent's origin
        const bone = new THREE.CylinderGeometry(0.008 * size, 0.008 * size, length, 8);
        const mesh = new THREE.Mesh(bone.translate(0, length / 2, 0), material(body.parent, null));
        const along = new THREE.Vector3(...body.position).normalize();
        mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along);
        moving[body.parent].add(mesh);
      }
    });
    const axes = scene.bodies.map((body) => new THREE.Vector3(...body.axis));
    const pose = (track, k) => {
      root.position.fromArray(track.position, 3 * k);
      root.quaternion.fromArray(track.attitude, 4 * k);
      const n = scene.bodies.length - 1;
      for (let i = 1; i <= n; i += 1) {
        const q = track.q[n * k + i - 1];
        if (scene.bodies[i].slides) moving[i].position.copy(axes[i]).multiplyScalar(q);
        else moving[i].quaternion.setFromAxisAngle(axes[i], q);
      }
    };
    return { root, moving, pose };
  }

  const trackOf = (track) => track && {
    position: floats(track.position), attitude: floats(track.attitude), q: floats(track.q) };

  /** An arrow from its place along a vector: a shaft and a tip, of solids, for lines are 1 px wide. */
  function arrowOf(color, size) {
    const paint = new THREE.MeshLambertMaterial({ color, emissive: color, emissiveIntensity: 0.4 });
    const root = new THREE.Group(), up = new THREE.Vector3(0, 1, 0);
    const part = (top, bottom) => {
      const mesh = new THREE.Mesh(new THREE.CylinderGeometry(top, bottom, 1, 16).translate(0, 0.5, 0), paint);
      root.add(mesh);
      return mesh;
    };
    const shaft = part(0.012 * size, 0.012 * size), tip = part(0, 0.035 * size);
    const point = (v, length) => {
      const head = Math.min(0.4 * length, 0.11 * size);
      root.quaternion.setFromUnitVectors(up, v.clone().normalize());
      shaft.scale.y = length - head;
      tip.scale.y = head;
      tip.position.y = length - head;
    };
    return { root, point };
  }

  /** Stars: what does not turn while a free robot does. Always the same ones. */
  function stars(far) {
    const corners = [], out = new THREE.Vector3(), side = new THREE.Vector3();
    for (let j = 1; j <= 400; j += 1) {
      const z = 2 * ((j * 0.6180339887) % 1) - 1, turn = 2 * Math.PI * ((j * j * 0.3247179572) % 1);
      out.set(Math.sqrt(1 - z * z) * Math.cos(turn), Math.sqrt(1 - z * z) * Math.sin(turn), z);
      const width = far * 0.0016 * (1 + ((j * 0.7548776662) % 1));
      side.set(-out.y, out.x, 0).setLength(width);
      const other = out.clone().cross(side);
      [[-1, -0.6], [1, -0.6], [0, 1.2]].forEach(([a, b]) => corners.push(
        ...out.clone().multiplyScalar(far).addScaledVector(side, a).addScaledVector(other, b)));
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute('position', new THREE.BufferAttribute(new Float32Array(corners), 3));
    geometry.computeVertexNormals();
    return new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ emissive: 0xb8c4d6, side: THREE.DoubleSide }));
  }

  /** Words for bodies at the left and right of the picture, one below the other. */
  function labels(marks, view, camera) {
    const all = marks.map(({ text, at }) => {
      const word = element('span', { className: 'mark', textContent: text });
      const lead = element('i', { className: 'lead' });
      view.append(lead, word);
      return { word, lead, at, seen: new THREE.Vector3() };
    });
    return () => {
      const { clientWidth: width, clientHeight: height } = view, below = { true: 8, false: 8 };
      all.forEach((one) => {
        one.at.getWorldPosition(one.seen).project(camera);
        one.x = (0.5 + 0.5 * one.seen.x) * width;
        one.y = (0.5 - 0.5 * one.seen.y) * height;
      });
      [...all].sort((a, b) => a.y - b.y).forEach(({ word, lead, x, y }) => {
        const w = word.offsetWidth, h = word.offsetHeight;
        const isRight = x > width / 2, left = isRight ? width - w - 8 : 8;
        const top = Math.max(below[isRight], Math.min(y - h / 2, height - h - 8));
        below[isRight] = top + h + 6;
        word.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
        const dx = (isRight ? left : left + w) - x, dy = top + h / 2 - y;
        lead.style.width = `${Math.hypot(dx, dy)}px`;
        lead.style.transform = `translate(${x}px, ${y}px) rotate(${Math.atan2(dy, dx)}rad)`;
      });
    };
  }

  function figure(place, index) {
    const scene = JSON.parse(place.querySelector('script').textContent);
    const time = Array.from(floats(scene.time)), last = time.length - 1;
    const measured = trackOf(scene.measured), predicted = trackOf(scene.predicted);
    const view = place.querySelector('.view');
    let renderer;
    try {
      renderer = new THREE.WebGLRenderer({ antialias: true, alpha: true, preserveDrawingBuffer: true });
    } catch {
      view.textContent = 'This browser draws no 3D (WebGL is off).';
      return;
    }
    const world = new THREE.Scene(), camera = new THREE.PerspectiveCamera(40, 1, 0.01, 1e4);
    camera.up.set(0, 0, 1);
    renderer.domElement.setAttribute('aria-label', 'the robot in 3D; drag to turn, wheel or pinch to zoom');
    view.append(renderer.domElement);
    world.add(new THREE.HemisphereLight(0xffffff, 0x777777, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(2, -3, 4);
    world.add(sun);

    const size = scene.size;
    const paint = scene.bodies.map((_, i) => new THREE.MeshLambertMaterial({ color: i ? curveColor((i - 1) % 6) : '#8a939c', side: THREE.DoubleSide }));
    const real = robot(scene, size, (i, color) => (color
      ? new THREE.MeshLambertMaterial({ color: new THREE.Color(...color), side: THREE.DoubleSide }) : paint[i]));
    world.add(real.root);
    const mist = new THREE.MeshLambertMaterial({ color: GHOST, transparent: true, opacity: 0.3, depthWrite: false, polygonOffset: true, polygonOffsetFactor: 2, polygonOffsetUnits: 8 });
    const ghost = predicted && robot(scene, size, () => mist);
    if (ghost) world.add(ghost.root);
    if (scene.is_free) {
      world.add(stars(100 * size));
    } else {
      const grid = new THREE.GridHelper(4 * size, 20, 0x888888, 0x888888);
      grid.rotation.x = Math.PI / 2;
      grid.material.transparent = true; grid.material.opacity = 0.25;
      world.add(grid);
    }

    const arrows = scene.arrows.map((arrow, k) => {
      const { root, point } = arrowOf(curveColor(k), size);
      if (arrow.body >= 0) {
        root.position.fromArray(scene.bodies[arrow.body].com);
        real.moving[arrow.body].add(root);
      } else world.add(root);
      return { ...arrow, values: floats(arrow.values), root, point, v: new THREE.Vector3() };
    });
    const longestOf = (isWheels) => Math.max(1e-12, ...arrows.filter(({ body }) => body >= 0 === isWheels)
      .flatMap(({ values }) => Array.from(values, Math.abs))); // wheels hold a part of the total
    const scales = { true: (0.5 * size) / longestOf(true), false: (0.9 * size) / longestOf(false) };
    const name = labels(scene.marks.map(({ body, text }) => {
      const at = new THREE.Group();
      at.position.fromArray(scene.bodies[body].com);
      real.moving[body].add(at);
      return { text, at };
    }), view, camera);

    const orbit = new THREE.OrbitControls(camera, renderer.domElement);
    const seen = new THREE.Box3(); // of the whole motion, by some of its pictures
    for (let j = 0; j <= 8; j += 1) {
      real.pose(measured, Math.round((j * last) / 8));
      real.root.updateMatrixWorld(true);
      seen.expandByObject(real.root);
    }
    const middle = seen.getCenter(new THREE.Vector3()), far = 1.05 * seen.getSize(new THREE.Vector3()).length();
    const eye = (x, y, z) => { camera.position.set(x, y, z).setLength(far).add(orbit.target); orbit.update(); };
    orbit.target.copy(middle);
    eye(1, -1.4, 0.8);

    let k = 0, playing = false, now = time[0], stamp = 0, dirty = true;
    const slider = element('input', { type: 'range', min: 0, max: last, step: 1, value: 0, className: 'time' });
    slider.setAttribute('aria-label', 'time');
    const play = element('button', { type: 'button', textContent: 'play' });
    const speed = element('select', { title: 'speed' }, ...[0.1, 0.25, 0.5, 1, 2, 4, 10].map((s) => element('option', { value: s, textContent: `${s} x`, selected: s === 1 })));
    const looks = { free: [1, -1.4, 0.8], 'along x': [1, 0, 0.001], 'along y': [0, 1, 0.001], 'from above': [0, -0.001, 1] };
    const look = element('select', { title: 'camera' }, ...[...Object.keys(looks), 'with the base'].map((name) => element('option', { textContent: name })));
    const shown = element('output', {});
    const bar = element('div', { className: 'bar' }, play, slider, shown, speed, look);
    if (ghost) {
      const box = element('input', { type: 'checkbox', checked: true });
      box.onchange = () => { ghost.root.visible = box.checked; dirty = true; };
      bar.append(element('label', {}, box, ' prediction'));
    }
    const legend = element('p', { className: 'legend' });
    const words = arrows.map((arrow, i) => {
      const swatch = element('i', { textContent: '\u2191 ' });
      swatch.style.color = curveColor(i);
      const size_ = element('span', {});
      legend.append(element('span', {}, swatch, `${arrow.label} `, size_, ' '));
      return size_;
    });
    view.after(bar, legend);

    const mark = (u) => {
      const x = u.valToPos(time[k], 'x', true), { ctx, bbox } = u;
      if (x < bbox.left || x > bbox.left + bbox.width) return;
      ctx.save(); ctx.strokeStyle = css('--accent'); ctx.lineWidth = 2 * devicePixelRatio;
      ctx.beginPath(); ctx.moveTo(x, bbox.top); ctx.lineTo(x, bbox.top + bbox.height); ctx.stroke(); ctx.restore();
    };
    const charts = scene.channels.map((channel, c) => {
      const y = floats(channel.values), below = place.appendChild(element('div', { className: 'channel' }));
      const curves = channel.labels.map((name, j) => ({
        label: name, y: y.subarray(j * time.length, (j + 1) * time.length), color: j, dash: Math.floor(j / 7) }));
      const u = chart(below, { title: channel.title, unit: channel.unit, abscissa: 'time [s]', x: time, curves },
        `replay-${index}`, { height: 170, draw: [mark], is_last: c === scene.channels.length - 1 });
      u.over.addEventListener('click', (event) => seek(u.posToVal(event.offsetX, 'x')));
      return u;
    });

    function seek(t) {
      now = Math.min(Math.max(t, time[0]), time[last]);
      const step = (time[last] - time[0]) / last || 1;
      k = Math.round((now - time[0]) / step);
      slider.value = k;
      dirty = true;
    }

    function draw() {
      real.pose(measured, k);
      if (ghost) ghost.pose(predicted, k);
      arrows.forEach((arrow, i) => {
        arrow.v.fromArray(arrow.values, arrow.values.length > 3 ? 3 * k : 0);
        const amount = arrow.v.length();
        arrow.root.visible = amount > 0;
        if (amount > 0) arrow.point(arrow.v, Math.max(scales[arrow.body >= 0] * amount, 0.02 * size));
        words[i].textContent = `${amount.toPrecision(4)} N m s`;
      });
      if (look.value === 'with the base') {
        orbit.target.copy(real.root.position);
        camera.position.set(1, -1.4, 0.8).setLength(far).applyQuaternion(real.root.quaternion).add(orbit.target);
        camera.up.set(0, 0, 1).applyQuaternion(real.root.quaternion);
        camera.lookAt(orbit.target);
      }
      shown.textContent = `${time[k].toFixed(2)} s`;
      renderer.render(world, camera);
      name();
    }

    function frame(at) {
      if (playing) {
        seek(now + ((at - stamp) / 1000) * Number(speed.value));
        if (now >= time[last]) toggle(false);
      }
      stamp = at;
      if (dirty) {
        dirty = false;
        draw();
        charts.forEach((u) => u.redraw(false, false));
      }
      requestAnimationFrame(frame);
    }

    function toggle(on) {
      playing = on;
      play.textContent = on ? 'pause' : 'play';
      if (on && now >= time[last]) seek(time[0]);
    }

    function resize() {
      const width = view.clientWidth, height = Math.max(240, Math.min(0.6 * width, 520));
      renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      renderer.setSize(width, height);
      camera.aspect = width / height;
      camera.updateProjectionMatrix();
      dirty = true;
    }

    play.onclick = () => toggle(!playing);
    slider.oninput = () => { toggle(false); seek(time[Number(slider.value)]); };
    look.onchange = () => {
      camera.up.set(0, 0, 1);
      orbit.target.copy(middle);
      if (looks[look.value]) eye(...looks[look.value]);
      dirty = true;
    };
    orbit.addEventListener('change', () => { dirty = true; });
    new ResizeObserver(resize).observe(view);
    resize();
    draw();
    requestAnimationFrame(frame);
    place.replay = { seek, draw, toggle, canvas: renderer.domElement, end: time[last], start: time[0] };
    place.classList.add('is-live');
  }

  document.addEventListener('DOMContentLoaded', () => {
    document.querySelectorAll('figure.replay').forEach(figure);
  });
})();
