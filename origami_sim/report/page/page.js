// what is folded away is opened where a link leads, and on paper
const unfold = target => {
  for (let e = target; e; e = e.parentElement) if (e.tagName === "DETAILS") e.open = true;
};
const follow = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  if (target) { unfold(target); target.scrollIntoView(); }
};
addEventListener("hashchange", follow);
addEventListener("DOMContentLoaded", follow);
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => { d.open = true; }));
