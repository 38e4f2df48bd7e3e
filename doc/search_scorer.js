// Which results the search shows first: pages whose title has what was typed, then their sections; behind
// them the pages that list everything.
const typed = (new URLSearchParams(window.location.search).get('q') || '').trim().toLowerCase();
const lists = /^(api\/|changes|contributing|benchmarks|interfaces|commands|examples)/;

var Scorer = {
  score: ([page, title, anchor, description, score]) =>
    score + (anchor ? 0 : 10) + (title.toLowerCase().includes(typed) ? 20 : 0) - (lists.test(page) ? 30 : 0),
  objNameMatch: 11,
  objPartialMatch: 6,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
