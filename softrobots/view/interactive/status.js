// What is told of a pose: status, numbers, and what links have left to wrinkling.
const css = ([red, green, blue]) => `rgb(${[red, green, blue].map((one) => Math.round(255 * one)).join(" ")})`;
const short = (value) =>
  value === 0
    ? "0"
    : Math.abs(value) < 1e-3 || Math.abs(value) >= 1e5
      ? value.toExponential(1)
      : String(Number(value.toPrecision(4)));

// A number with so many digits behind the point, without a sign on zero.
const fixed = (value, digits) => (Number(value.toFixed(digits)) + 0).toFixed(digits);

function report(found) {
  const box = $("status"),
    wrinkled = found.status === CERTIFIED && found.links.some((link) => link.wrinklingMargin <= 0),
    state = found.status === NEUTRAL || wrinkled ? "neutral" : found.status === CERTIFIED ? "good" : "bad";
  box.className = state;
  box.children[1].textContent = wrinkled ? `${found.statusText}, but wrinkled` : found.statusText;
  box.children[2].textContent = state === "bad" ? "the last certified pose stays" : "";
  const [x, y, z] = (shown ?? found).tip.map((one) => fixed(one, 4).replace("-", "\u2212"));
  const rows = [
    ["tip [m]", shown ? `${x}  ${y}  ${z}` : "-"],
    ["residual [N m]", short(found.residual)],
    ["smallest pivot [-]", short(found.minPivot)],
    ["solved in [ms]", rates.toFixed(rates < 10 ? 1 : 0)],
  ];
  $("facts").replaceChildren(
    ...rows.map(([name, text]) => {
      const row = document.createElement("tr"),
        head = document.createElement("th"),
        cell = document.createElement("td");
      head.textContent = name;
      head.scope = "row";
      cell.textContent = text;
      row.append(head, cell);
      return row;
    }),
  );
  if (shown)
    $("links").replaceChildren(
      ...told(shown.links).map(([share, name]) => {
        const line = document.createElement("div"),
          swatch = document.createElement("i");
        swatch.style.background = css(data.colours.wrinkling[level(share)][1]);
        line.append(swatch, share <= 0 ? `${name}: wrinkled` : `${name}: ${Math.round(100 * share)} % left to wrinkling`);
        return line;
      }),
    );
}

function told(links) {
  // each link, or of many the nearest to wrinkling
  const rows = links.map((link) => [link.wrinklingMargin, link.name]);
  if (rows.length <= 4) return rows;
  const [share, name] = rows.reduce((least, row) => (row[0] < least[0] ? row : least));
  return [[share, `${name}, the nearest of ${rows.length}`]];
}
