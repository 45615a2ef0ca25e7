// The motion of a scene: bodies in space, points and bars in a plane, the profile of a chain, or coordinates over time.
// The first three are drawn as an animation that can be stopped, and that waits where less motion is preferred.
'use strict';
const motionPicture = (() => {
  const framesPerSecond = 25, shortest = 8, longest = 40, mostTrails = 8;
  const inUnit = (name, unit) => unit ? `${name} [${unit}]` : name;

  // A value between the samples k and k + 1, on the cubic through their neighbours.
  function between(values, at) {
    const last = values.length - 1, k = Math.min(Math.floor(at), last - 1), s = at - k;
    if (last < 1) return values[0];
    const [a, b] = [values[k], values[k + 1]], slope = i => (values[Math.min(i + 1, last)] - values[Math.max(i - 1, 0)]) /
      (Math.min(i + 1, last) - Math.max(i - 1, 0));
    const [u, v] = [slope(k), slope(k + 1)];
    return a + s * (u + s * (3 * (b - a) - 2 * u - v + s * (2 * (a - b) + u + v)));
  }

  function trail(motion, body, steps) {
    const points = [], count = (motion.time.length - 1) * steps;
    for (let i = 0; i <= count; ++i) {
      const at = i / steps, whole = i % steps === 0;
      const x = between(motion.values[body.x], at), y = between(motion.values[body.y], at);
      points.push({ x, y, tip: whole ? () => `t = ${motion.time[at]}\nx = ${x.toPrecision(6)}\ny = ${y.toPrecision(6)}` : null });
    }
    return points;
  }

  function planeSpec(motion, spec) {
    const { bodies, pins, names, units } = motion, every = Math.ceil(bodies.length / mostTrails), one = bodies.length === 1;
    const trails = bodies.filter((_, i) => (i + 1) % every === 0 || i === bodies.length - 1);
    const steps = motion.time.length * trails.length > 3000 ? 1 : 4;
    const series = trails.map((body, i) => ({ label: one ? '' : body.name, colour: `var(--series-${i % 6})`, width: 1,
      body, points: trail(motion, body, steps) }));
    const x = bodies[0].x, y = bodies[0].y, reach = axis => bodies.flatMap(b => motion.values[b[axis]]).concat(
      pins.map(pin => pin[axis === 'x' ? 0 : 1]));
    return { ...spec, series, equal: units[x] === units[y], legend: !one && motion.bars.length === 0,
      x: { label: inUnit(one ? names[x] : 'x', units[x]), include: reach('x') },
      y: { label: inUnit(one ? names[y] : 'y', units[y]), include: reach('y') } };
  }

  // Returns draw(at), which puts bars and bodies where they are at sample `at`.
  function planeFrame(motion, picture, spec) {
    const bars = Plot.make('path', { style: 'fill:none;stroke:var(--ink);stroke-width:2;stroke-linecap:round' }, picture.layer);
    for (const pin of motion.pins)
      Plot.make('circle', { cx: picture.x(pin[0]), cy: picture.y(pin[1]), r: 3, style: 'fill:var(--muted)' }, picture.layer);
    const many = motion.bodies.length > 20;
    const colour = body => (spec.series.find(s => s.body === body) || { colour: 'var(--ink)' }).colour;
    const dots = motion.bodies.map(body => Plot.make(body.heading === undefined ? 'circle' : 'path',
      body.heading === undefined ? { r: many ? 2.2 : 6, style: `fill:${many ? 'var(--ink)' : colour(body)}` }
        : { d: 'M14,0L-8,6L-4,0L-8,-6z', style: 'fill:var(--ink)' }, picture.layer));
    return at => {
      const places = motion.bodies.map(b => [picture.x(between(motion.values[b.x], at)),
        picture.y(between(motion.values[b.y], at))]);
      const end = i => i < 0 ? [picture.x(motion.pins[-1 - i][0]), picture.y(motion.pins[-1 - i][1])] : places[i];
      bars.setAttribute('d', motion.bars.map(([from, to]) => `M${end(from)}L${end(to)}`).join(''));
      dots.forEach((dot, i) => {
        const heading = motion.bodies[i].heading;
        const turn = heading === undefined ? '' : ` rotate(${-between(motion.values[heading], at) * 180 / Math.PI})`;
        dot.setAttribute('transform', `translate(${places[i]})${turn}`);
      });
    };
  }

  function profileSpec(motion, spec) {
    const family = motion.names[0].replace(/_\d+$/, '');
    const start = motion.values.map((values, i) => ({ x: motion.numbers[i], y: values[0],
      tip: () => `${motion.names[i]} at the start: ${values[0]}` }));
    return { ...spec, x: { label: 'number of the element [1]' },
      y: { label: inUnit(family, motion.units[0]), include: Plot.extent(motion.values.flat()) },
      series: [{ label: 'start', colour: 'var(--baseline-erk)', dash: '4,3', width: 1.2, points: start },
        { label: 'now', colour: 'var(--series-0)', points: start.slice(0, 1) }] };
  }

  function profileFrame(motion, picture) {
    const line = Plot.make('path', { style: 'fill:none;stroke:var(--series-0);stroke-width:1.8' }, picture.layer);
    return at => line.setAttribute('d', 'M' + motion.values.map((values, i) =>
      `${picture.x(motion.numbers[i]).toFixed(1)},${picture.y(between(values, at)).toFixed(1)}`).join('L'));
  }

  function curvesSpec(motion, spec) {
    const alike = motion.units.every(unit => unit === motion.units[0]);
    return { ...spec, x: { label: motion.timeLabel },
      y: { label: alike ? inUnit('coordinates', motion.units[0]) : 'coordinates, units in the legend' },
      series: motion.names.map((name, i) => ({ label: inUnit(name, motion.units[i]), colour: `var(--series-${i % 6})`,
        points: motion.time.map((t, k) => ({ x: t, y: motion.values[i][k],
          tip: () => `t = ${t}\n${name} = ${motion.values[i][k]}` })) })) };
  }

  // A button, a slider and the time; they outlive the picture, which is drawn anew for another width.
  function controls(figure, motion) {
    const bar = figure.querySelector('.tools'), button = document.createElement('button');
    const slider = Object.assign(document.createElement('input'), { type: 'range', min: 0, value: 0, step: 'any',
      max: motion.time.length - 1 });
    slider.setAttribute('aria-label', 'time');
    const time = document.createElement('output');
    button.type = 'button';
    bar.prepend(button, slider, time);
    return { button, slider, time };
  }

  function player(figure, motion) {
    const { button, slider, time } = controls(figure, motion), last = motion.time.length - 1;
    const seconds = Math.min(longest, Math.max(shortest, last / framesPerSecond));
    const state = { draw: () => {}, at: 0 };
    let before = null, visible = false, wanted = !matchMedia('(prefers-reduced-motion: reduce)').matches, frame = 0;
    const show = () => {
      state.draw(state.at);
      slider.value = state.at;
      time.value = `t = ${between(motion.time, state.at).toPrecision(4)}`;
    };
    const tick = now => {
      if (before !== null) state.at = (state.at + (now - before) / 1000 * last / seconds) % last;
      before = now;
      show();
      frame = requestAnimationFrame(tick);
    };
    const update = () => {
      cancelAnimationFrame(frame);
      before = null;
      button.textContent = wanted ? '❚❚ Pause' : '▶ Play';
      if (wanted && visible) frame = requestAnimationFrame(tick);
    };
    button.addEventListener('click', () => { wanted = !wanted; update(); });
    slider.addEventListener('input', () => { state.at = Number(slider.value); wanted = false; update(); show(); });
    new IntersectionObserver(entries => { visible = entries.at(-1).isIntersecting; update(); }).observe(figure);
    return Object.assign(state, { show });
  }

  // The centres of bodies from above, where there is no three.js or no WebGL.
  function fromAbove(motion) {
    const moving = motion.solids.filter(body => body.coordinates.length);
    return { ...motion, form: 'plane', pins: motion.solids.filter(body => !body.coordinates.length).map(body => body.fixed.slice(0, 2)),
      bodies: moving.map(({ name, coordinates }) => ({ name, x: coordinates[0], y: coordinates[1],
        ...(coordinates.length === 3 ? { heading: coordinates[2] } : {}) })) };
  }

  // Bodies in space: turned by dragging, zoomed with the wheel; the view keeps its own canvas.
  function spaceView(figure, motion) {
    const box = document.createElement('div');
    box.className = 'view';
    figure.insertBefore(box, figure.querySelector('.tools'));
    try {
      const view = bodyView.BodyView(box, motion, between);
      view.canvas.setAttribute('aria-label', `${figure.dataset.description}, in space; drag or arrow keys turn, wheel or + and - zoom`);
      return view;
    } catch (error) {
      box.remove();
      return null;
    }
  }

  // draw() of the figure; called once for each width.
  return function draw(figure, motion, spec) {
    if (motion.form === 'space') {
      let shown = null;
      return () => {
        if (shown) return shown();
        const view = typeof bodyView === 'undefined' ? null : spaceView(figure, motion);
        if (!view) return (shown = draw(figure, fromAbove(motion), spec))();
        figure.querySelectorAll('img, svg').forEach(picture => picture.remove());
        const playing = player(figure, motion);
        playing.draw = view.draw;
        figure.bodyView = view;
        figure.querySelector('[data-file=svg]').remove();  // a canvas has no such file
        shown = () => { view.resize(); playing.show(); };
        shown();
      };
    }
    if (motion.form === 'curves') return () => Plot(figure, curvesSpec(motion, spec));
    const [specOf, frameOf] = motion.form === 'plane' ? [planeSpec, planeFrame] : [profileSpec, profileFrame];
    const whole = specOf(motion, spec), playing = player(figure, motion);
    return () => {
      playing.draw = frameOf(motion, Plot(figure, whole), whole);
      playing.show();
    };
  };
})();
