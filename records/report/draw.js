"use strict";
// Draws the figures one after another, so that the page is readable while the later ones are still coming.
const config = {
  displaylogo: false,
  responsive: true,
  modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]],
};
const ink = "#1d2730";
const axis = {
  gridcolor: "#e8ebee", zerolinecolor: "#b9c1c9", linecolor: "#b9c1c9", ticks: "outside", tickcolor: "#b9c1c9",
  ticklen: 4, automargin: true, title: { standoff: 8, font: { size: 12.5 } }, minor: { gridcolor: "#f4f5f7" },
};
const template = {
  layout: {
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: ink },
    paper_bgcolor: "#fff", plot_bgcolor: "#fff", xaxis: axis, yaxis: axis,
    margin: { l: 60, r: 12, t: 54, b: 44 }, // a row for the buttons above the legend
    legend: { orientation: "h", x: 0, y: 1, xanchor: "left", yanchor: "bottom", font: { size: 12 } },
    modebar: { bgcolor: "rgba(255,255,255,0.85)", color: "#8a939c", activecolor: "#134a7c" },
    hoverlabel: { font: { size: 12 } },
  },
};

async function draw(figures) {
  for (const figure of figures) {
    const place = document.getElementById(figure.name);
    await Plotly.newPlot(place, figure.data, { ...figure.layout, template, height: figure.height }, config);
    if (figure.frames.length > 0) await Plotly.addFrames(place, figure.frames);
    await new Promise((next) => setTimeout(next, 0));
  }
  document.body.dataset.drawn = figures.length;
}

draw(JSON.parse(document.getElementById("figures").textContent));
