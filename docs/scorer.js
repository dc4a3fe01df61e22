// How the search of the site ranks pages: those for users first, the record of changes last.
const LATER = [
  [/^changelog/, 9],
  [/^verification\//, 4],
  [/^fortran/, 3],
  [/^(start|index)/, 2],
  [/^(python|namelists|examples)/, 1],
];
// Pages of developers come after others of like score, and later where only their text has the word.
const DEVELOPERS = /^(architecture|house|decisions|development|contributing)/;

var Scorer = {
  score: ([page, , , , score]) => {
    const found = LATER.find(([pages]) => pages.test(page));
    return score - (found ? found[1] : 0) - (DEVELOPERS.test(page) ? (score < Scorer.title ? 3 : 1) : 0);
  },
  // A name that is asked for, and a part of it.
  objNameMatch: 11,
  objPartialMatch: 1,
  objPrio: { 0: 15, 1: 5, 2: -5 },
  objPrioDefault: 0,
  title: 15,
  partialTitle: 7,
  term: 5,
  partialTerm: 2,
};
