// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace helicarm::report {

/// Style sheet of the report, light or dark by the reader's system setting.
inline constexpr const char* report_style = R"css(
:root { color-scheme: light dark; --ink: #1d2326; --soft: #5d686e; --paper: #fbfaf7; --card: #fff; --rule: #dcd8cf;
  --accent: #0b6e75; --good: #1b7a43; --bad: #b3261e; --bar: #0b6e7533; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e4de; --soft: #9aa5ab; --paper: #14181a; --card: #1c2225;
  --rule: #333c41; --accent: #5cc4c9; --good: #6fcf97; --bad: #ff8a80; --bar: #5cc4c944; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 76rem; padding: 2.5rem 1.5rem 4rem; background: var(--paper); color: var(--ink);
  font: 1.0625rem/1.55 "Iowan Old Style", "Palatino Linotype", Palatino, "Book Antiqua", Georgia, serif; }
h1 { font-size: 2.1rem; font-weight: 600; letter-spacing: -0.01em; margin: 0; }
h2 { font-size: 1.35rem; font-weight: 600; margin: 3rem 0 0.8rem; }
p { max-width: 42rem; }
.notice { color: var(--bad); font-style: italic; margin: 0.3rem 0 1.5rem; }
.soft, figcaption { color: var(--soft); font-size: 0.92rem; }
.state { display: inline-block; padding: 0.1rem 0.7rem; border-radius: 1rem; border: 1px solid; font-size: 0.95rem; }
.state.ok { color: var(--good); } .state.refused { color: var(--bad); }
.cards { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: 1rem; margin: 1.5rem 0; }
.card { background: var(--card); border: 1px solid var(--rule); border-radius: 0.6rem; padding: 0.9rem 1.1rem; }
.card b { display: block; font-size: 1.7rem; font-weight: 600; font-variant-numeric: tabular-nums lining-nums; }
.card span { color: var(--soft); font-size: 0.9rem; }
.views { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 30rem), 1fr)); gap: 1.5rem; margin-top: 1rem; }
figure { margin: 0; }
figure svg { width: 100%; height: auto; display: block; border-radius: 0.4rem; background: #000; }
figure.plain svg { background: var(--card); border: 1px solid var(--rule); }
figcaption { padding-top: 0.4rem; }
figure label { display: flex; align-items: center; gap: 0.8rem; padding-top: 0.4rem; font-size: 0.92rem; } figure label[hidden] { display: none; }
figure input { flex: 1; accent-color: var(--accent); }
.legend { display: flex; flex-wrap: wrap; gap: 0 0.9rem; }
.key { display: inline-block; width: 0.8rem; height: 0.8rem; border-radius: 0.15rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums lining-nums; font-size: 0.96rem; }
th { text-align: left; font-weight: 600; color: var(--soft); border-bottom: 1px solid var(--ink); }
th, td { padding: 0.28rem 0.7rem 0.28rem 0; white-space: nowrap; vertical-align: baseline; }
td { border-bottom: 1px solid var(--rule); }
.n { text-align: right; }
.bad { color: var(--bad); }
.error { display: inline-block; height: 0.7rem; background: var(--bar); border-left: 2px solid var(--accent); }
svg { fill: none; font-family: system-ui, sans-serif; }
svg text { fill: #fff; paint-order: stroke; stroke: #000c; stroke-width: 3px; stroke-linejoin: round; }
svg .ball { stroke: #4ade80; } svg .candidate { stroke: #fb923c; } svg .guess { fill: #fb923c; } svg .lost { stroke: #f87171; stroke-dasharray: 4 3; } svg .plate { stroke: #93c5fd99; }
svg .residual { stroke: #fb923c; stroke-width: 2; } svg .false { stroke: #f87171; } svg .point { stroke: #f0abfc; }
svg .planned { stroke: #facc15; stroke-width: 2; } svg .tool { stroke: #ef4444; } svg .bar { stroke: #fff; stroke-width: 3; }
.plain svg text { fill: var(--ink); stroke: none; } .plain svg .bar { stroke: var(--ink); }
svg .field { stroke: var(--accent); } svg .frame { stroke: var(--rule); }
@media print { body { max-width: none; padding: 0; } h2 { break-after: avoid; } figure, tr { break-inside: avoid; } }
)css";

}  // namespace helicarm::report
