"""Style and script of the diagnosis page: dark on white, colours that every eye tells apart (after Okabe and Ito)."""

STYLE = """
:root { --ink: #1f2328; --quiet: #57606a; --rule: #d8dee4; --soft: #f6f8fa; --link: #0a4f8f;
  --recorded: #8b9098; --before: #c2500a; --refitted: #8a4f86; --after: #0067a8; --place: #0b6b57; }
* { box-sizing: border-box; }
html { scroll-padding-top: 3.4rem; -webkit-text-size-adjust: 100%; }
body { font: 16px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif;
  color: var(--ink);
  background: #fff; max-width: 76rem; margin: 0 auto; padding: 1.4rem 1.25rem 4rem; overflow-wrap: break-word; }
h1 { font-size: 1.15rem; font-weight: 600; margin: 0; }
h2 { font-size: 1.35rem; line-height: 1.25; margin: 0 0 .7rem; }
h3 { font-size: 1rem; margin: 1.2rem 0 .4rem; }
p { margin: .4rem 0; max-width: 48rem; }
a { color: var(--link); text-underline-offset: .15em; }
:focus-visible { outline: 3px solid #0a4f8f; outline-offset: 2px; border-radius: 3px; }
code { background: var(--soft); padding: .1em .35em; border-radius: 4px;
  font: .875em/1.4 ui-monospace, Menlo, Consolas, monospace; }
pre { background: var(--soft); padding: .7rem .9rem; overflow-x: auto; border-radius: 6px; } pre code {
  padding: 0; }
small, .quiet, .nothing, figcaption { font-size: .875rem; color: var(--quiet); }
.nothing { font-style: italic; }
section { margin-top: 3rem; padding-top: 1.6rem; border-top: 1px solid var(--rule); }
.skip { position: absolute; left: -99rem; } .skip:focus { left: 1rem; top: .4rem; background: #fff;
  padding: .3rem; z-index: 9; }

.verdict { --v: #3c4450; position: relative; border-left: .5rem solid var(--v);
  background: color-mix(in srgb, var(--v) 7%, #fff);
  border-radius: 6px; padding: 1.1rem 1.4rem 1.2rem; margin: .9rem 0 1rem; display: grid; column-gap: 2rem;
  grid-template-columns: 1fr auto; align-items: center; }
.verdict > div:first-child { grid-column: 1; color: var(--quiet); font-size: .95rem; }
.pill { display: inline-block; background: var(--v); color: #fff; font-weight: 700; letter-spacing: .06em;
  font-size: .82rem;
  padding: .12rem .65rem; border-radius: 99px; margin-right: .7rem; }
.sentence { grid-column: 1; font-size: 1.42rem; line-height: 1.36; font-weight: 600; margin: .6rem 0 0;
  max-width: 52rem;
  text-wrap: pretty; }
.sure { grid-column: 2; grid-row: 1 / 3; text-align: center; color: var(--v); }
.sure b { display: block; font-size: 2.7rem; line-height: 1.1; font-variant-numeric: tabular-nums;
  white-space: nowrap; }
.sure span { font-size: .85rem; }
.v-adequate { --v: #0b6b4f; } .v-parameter { --v: #0a5a9c; } .v-measurement { --v: #6d3f8f; } .v-mechanism {
  --v: #a83e00; }
.v-tie { --v: #7a5a00; } .v-several { --v: #9a2a2a; } .v-unknown { --v: #2f3542; } .v-untestable {
  --v: #5c636c; }

.claims { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(100%, 16.5rem), 1fr)); gap: .6rem;
  }
.claims a { display: flex; flex-direction: column; border: 1px solid var(--rule); border-radius: 6px;
  padding: .55rem .8rem .5rem;
  color: inherit; text-decoration: none; min-width: 0; }
.claims a:hover { border-color: var(--link); background: var(--soft); }
.claim { font-size: .78rem; color: var(--quiet); } .finding { font-weight: 600; font-size: .95rem;
  line-height: 1.35; flex: 1; }
.to { font-size: .78rem; color: var(--link); margin-top: .2rem; } .to::after { content: " ↓"; }
nav { position: sticky; top: 0; background: #fff; z-index: 5; margin: 1.4rem -.25rem -1.6rem;
  border-bottom: 1px solid var(--rule); }
nav ul { display: flex; gap: 0; list-style: none; margin: 0; padding: 0; overflow-x: auto; white-space: nowrap;
  font-size: .84rem; }
nav a { display: block; padding: .6rem .55rem; text-decoration: none; } nav a:hover {
  text-decoration: underline; }

.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 13rem), 1fr)); gap: .6rem;
  margin-bottom: 1.2rem; }
.tile { background: var(--soft); border-radius: 6px; padding: .7rem .9rem; display: flex;
  flex-direction: column; }
.tile span { font-size: .82rem; color: var(--quiet); } .tile b { font-size: 1.4rem; line-height: 1.3;
  font-variant-numeric: tabular-nums; }

.scroll { overflow-x: auto; max-width: 100%; margin: .5rem 0 .8rem; }
table { border-collapse: collapse; font-size: .875rem; line-height: 1.4; min-width: min(100%, 30rem);
  font-variant-numeric: tabular-nums; }
th, td { text-align: left; vertical-align: top; padding: .42rem .75rem .42rem 0;
  border-bottom: 1px solid var(--rule); }
thead th { color: var(--quiet); font-weight: 600; font-size: .8rem; vertical-align: bottom;
  border-bottom: 1.5px solid #9aa3ad; }
tbody th { font-weight: 600; min-width: 8.5rem; max-width: 18rem; } td { max-width: 20rem; }
td.n, th.n { white-space: nowrap; } td small { white-space: nowrap; }
table.wide { min-width: 66rem; width: 100%; } table.wide td:nth-last-child(-n+2) { min-width: 10.5rem; }
table.wide tbody th { min-width: 10rem; }
.tag { display: block; font-weight: 400; } .fitted + .fitted { margin-top: .35rem; } .fitted small {
  display: block; }
.fitted .name { color: var(--quiet); display: block; }
tr.chosen > *, tr.ours > * { background: #eef5fb; } tr.chosen > :first-child, tr.ours > :first-child {
  box-shadow: inset 4px 0 0 var(--after); padding-left: .75rem; }
tr.failed { color: var(--quiet); } td.warn { color: #8a2a00; } td.warn::before { content: "▲ ";
  font-size: .75em; }
.badge { border: 1px solid #8a2a00; color: #8a2a00; border-radius: 4px; font-size: .75rem; padding: 0 .3rem;
  white-space: nowrap; }
.barred { min-width: 6.5rem; } .barred span { display: block; }
.bar { display: block; height: 5px; background: #e6eaee; border-radius: 3px; margin-top: .15rem; } .bar i {
  display: block; height: 100%;
  background: var(--after); border-radius: 3px; }
td.strip, th.strip { width: 100%; min-width: 15rem; max-width: none; padding: 0 1.2rem 0 .4rem;
  vertical-align: middle; }
td.strip svg { display: block; width: 100%; height: 2rem; overflow: visible; }
.logaxis { position: relative; height: 1.3rem; } .logaxis span { position: absolute;
  transform: translateX(-50%); bottom: 0; }
.matrix { min-width: 0; } .matrix td.cell { text-align: center; padding: .35rem .3rem; min-width: 2.9rem;
  border: 2px solid #fff; }
.matrix th { padding-right: .6rem; white-space: nowrap; max-width: none; border: 0; } .matrix thead th.n {
  text-align: center; }
.matrix .light { color: #fff; } .matrix .twin { outline: 2px solid #000; outline-offset: -3px;
  font-weight: 700; }

.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 22rem), 1fr));
  gap: 1.2rem 1.6rem; }
.figures.three { grid-template-columns: repeat(auto-fill, minmax(min(100%, 16.5rem), 1fr)); }
figure { display: flex; flex-direction: column; justify-content: flex-end; margin: .4rem 0; min-width: 0; }
figcaption b { color: var(--ink); }
.plot { position: relative; margin: 1.5rem .5rem 2.6rem 3.1rem; font-size: .75rem; line-height: 1;
  color: var(--quiet);
  font-variant-numeric: tabular-nums; } .plot.bare { margin-bottom: 0; }
.plot svg { position: absolute; inset: 0; width: 100%; height: 100%; overflow: hidden;
  border-bottom: 1px solid #9aa3ad; }
.plot span { position: absolute; white-space: nowrap; }
.ty { right: calc(100% + .45rem); transform: translateY(50%); } .tx { top: calc(100% + .4rem);
  transform: translateX(-50%); }
.ny { bottom: calc(100% + .45rem); left: -2.9rem; } .nx { top: calc(100% + 1.5rem); right: 0; }
svg path { fill: none; stroke-width: 1.6; vector-effect: non-scaling-stroke; stroke-linejoin: round; }
svg path.grid { stroke: #e9edf0; stroke-width: 1; } svg path.zero { stroke: #9aa3ad; stroke-width: 1; }
svg path.floor { stroke: #1f2328; stroke-width: 1.5; }
svg path.recorded { stroke: var(--recorded); stroke-width: 4; opacity: .75; } svg path.before {
  stroke: var(--before); stroke-dasharray: 6 3; }
svg path.refitted { stroke: var(--refitted); stroke-dasharray: 2 3; } svg path.after { stroke: var(--after); }
svg path.other { stroke: #57606a; } svg path.place { stroke: var(--place); }
svg path.band { fill: var(--after); fill-opacity: .16; stroke: none; } svg path.noise { fill: #6b7683;
  fill-opacity: .17; stroke: none; }
svg path.cut { stroke: #b6bec7; stroke-width: 1; stroke-dasharray: 2 2; }
svg path.onset { stroke: #1f2328; stroke-width: 1.2; stroke-dasharray: 1 3; }
svg path.dots { stroke-width: 6; stroke-linecap: round; stroke-dasharray: none; opacity: 1; }
svg path.dots.big { stroke-width: 12; }
svg path.tick { stroke-width: 2; stroke-dasharray: none; opacity: .6; }
.legendrow { display: flex; flex-wrap: wrap; gap: .2rem 1.6rem; align-items: baseline; font-size: .875rem;
  color: var(--quiet); }
.legendrow p { margin: .2rem 0; } .key { display: inline-block; margin-right: 1.1rem; white-space: nowrap; }
figcaption .key { margin-right: .6rem; } figcaption .key.key::before { width: 1rem; margin-right: .25rem; }
.key::before { content: ""; display: inline-block; width: 1.5rem; margin-right: .4rem; vertical-align: .25em;
  border-top: 2.5px solid; }
.k-recorded::before { border-top: 5px solid var(--recorded); opacity: .75; } .k-before::before {
  border-top: 2.5px dashed var(--before); }
.k-refitted::before { border-top: 2.5px dotted var(--refitted); } .k-after::before {
  border-top-color: var(--after); }

.map { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 1fr); gap: 2rem; align-items: start; }
.map table { min-width: 100%; } .heat { max-width: 44rem; width: 100%; }
.origami { position: relative; width: 100%; background: #fbfbfa;
  border: 1px solid var(--rule); border-radius: 6px; }
.origami svg { position: absolute; inset: 0; width: 100%; height: 100%; }
.origami .face { stroke-width: .5; opacity: .93; } .origami .edge { stroke: #7d858e; stroke-width: 1.2; }
.origami .casing { stroke: #30363d; stroke-width: 9; stroke-linecap: round; } .origami .crease {
  stroke-width: 6.5; stroke-linecap: round; }
.origami .held { stroke: #30363d; stroke-width: 8; stroke-linecap: square; }
.at { position: absolute; transform: translate(-50%, -50%); background: #fffffff0; border: 1px solid #b6bec7;
  border-radius: 4px;
  padding: .1rem .35rem; font-size: .74rem; line-height: 1.3; white-space: nowrap; }
.ramp { display: flex; align-items: center; gap: .5rem; margin: .2rem 0; max-width: 20rem; } .ramp i { flex: 1;
  height: .7rem; border: 1px solid #9aa3ad; }
.chip { display: inline-block; background: var(--soft); border: 1px solid var(--rule); border-radius: 99px;
  padding: 0 .6rem; margin: .1rem .3rem .1rem 0; }
details { margin: .8rem 0; } summary { cursor: pointer; } summary h3 { display: inline; }
.experiments { padding: 0; list-style: none; counter-reset: e; display: grid; gap: .6rem;
  grid-template-columns: repeat(auto-fit, minmax(min(100%, 20rem), 1fr)); }
.experiments li { border: 1px solid var(--rule); border-radius: 6px; padding: .7rem .9rem; display: flex;
  flex-direction: column; gap: .25rem; }
.experiments li.best { border: 2px solid var(--place); background: #f2f9f7; } .experiments span {
  font-size: .9rem; }
.two { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 24rem), 1fr)); gap: 0 2.5rem; }

@media (max-width: 52rem) { .map { grid-template-columns: minmax(0, 1fr); } }
@media (max-width: 38rem) {
  .matrix tbody th, .matrix thead th:first-child { white-space: normal; min-width: 8rem; }
  body { padding: .9rem .8rem 3rem; } section { margin-top: 2.2rem; }
  .verdict { grid-template-columns: 1fr; padding: .9rem 1rem; } .sentence { font-size: 1.15rem; }
  .sure { grid-column: 1; grid-row: auto; text-align: left; margin-top: .6rem; } .sure b { display: inline;
  font-size: 1.9rem; margin-right: .5rem; }
  .pill { display: table; margin-bottom: .3rem; } .claims { grid-template-columns: 1fr; gap: .4rem; }
}
@media print {
  body { font-size: 10pt; max-width: none; padding: 0; } nav, .skip { display: none; } .scroll {
  overflow: visible; }
  table.wide { min-width: 0; font-size: 7.5pt; } figure, tr, .tile, .experiments li { break-inside: avoid; }
h2, h3 { break-after: avoid; }
  * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""

SCRIPT = """
// only paper needs this: what is folded away on the screen is printed
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => { d.open = true; }));
"""
