// Names and keyboard focus that the theme leaves out.
document.querySelectorAll(".md-search").forEach((search) => search.setAttribute("aria-label", "Search"));
document.querySelectorAll(".md-typeset__scrollwrap").forEach((table) => table.setAttribute("tabindex", "0"));
document.querySelectorAll(".md-code__nav").forEach((nav, place) => nav.setAttribute("aria-label", `Code ${place + 1}`));
new MutationObserver((changes) =>
  changes.forEach((change) =>
    change.addedNodes.forEach((node) => node.matches?.(".md-typeset__scrollwrap") && node.setAttribute("tabindex", "0")),
  ),
).observe(document.querySelector(".md-content") ?? document.body, { childList: true, subtree: true });
