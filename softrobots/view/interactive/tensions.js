// Tensions of the actuators: colours along them, words beside their sliders, and their scale in the legend.
const firstMuscle = actuators.length - data.elastic.length,
  tensionWords = [...document.querySelectorAll("#motors .row > span:first-child")].slice(firstMuscle).map((label) => {
    const words = document.createElement("small");
    label.append(words);
    return words;
  });

// The smallest of 1, 2 and 5 times a power of ten that no tension exceeds [N].
function scaleEnd(tensions) {
  const largest = Math.max(...tensions.map(Math.abs)),
    power = 10 ** Math.floor(Math.log10(largest));
  return largest > 1e-12 ? [1, 2, 5, 10].map((one) => one * power).find((one) => one >= largest * (1 - 1e-9)) : 1;
}

function tensionColour(tension, end) {
  const { pull, push, zero } = data.colours,
    share = Math.min(Math.abs(tension) / end, 1),
    [light, dark] = tension > 0 ? pull : push;
  return share < data.tensions.neutral ? zero : light.map((one, part) => one + share * (dark[part] - one));
}

const tensionInWords = (tension) => {
  const size = Math.abs(tension),
    told = size < 1000 ? Number(size.toPrecision(3)) : Math.round(size);
  return tension === 0 ? "0 N" : `${tension > 0 ? "pulls" : "pushes"} ${told} N`;
};

function showTensions({ tensions }) {
  if (!tensions.length) return;
  const end = scaleEnd(tensions),
    slack = tensions.map((one, muscle) => data.elastic[muscle] && one <= 0);
  tensions.forEach((tension, muscle) => {
    const told = Math.abs(tension) < data.tensions.zero * end ? 0 : tension,
      curve = scene.curves[muscle].drawn;
    tensionWords[muscle].textContent = slack[muscle] ? "slack" : tensionInWords(told);
    curve.mesh.material.color.setRGB(...tensionColour(tension, end));
    curve.dash(slack[muscle]);
  });
  const shares = [
    ...(Math.max(...tensions) > 0 ? [1, 0.5] : []),
    0,
    ...(Math.min(...tensions) < 0 ? [-0.5, -1] : []),
  ];
  const entries = shares.map((share) => [css(tensionColour(share * end, end)), tensionInWords(share * end)]);
  const grey = css(data.colours.zero);
  if (slack.includes(true)) entries.push([`repeating-linear-gradient(90deg, ${grey} 0 4px, #fff 4px 7px)`, "slack"]);
  $("tensions").replaceChildren(
    ...entries.map(([background, words]) => {
      const line = document.createElement("div"),
        swatch = document.createElement("span");
      swatch.style.background = background;
      line.append(swatch, words);
      return line;
    }),
  );
}
