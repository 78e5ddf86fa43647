// The index as a list that can be searched, with ages told from today's date. Without this everything is shown.
(function () {
  'use strict';
  var form = document.getElementById('search'), box = document.getElementById('query'), found = document.getElementById('found');
  var groups = [].slice.call(document.querySelectorAll('[data-rig]')), cards = [].slice.call(document.querySelectorAll('.card'));

  function plain(text) { return text.normalize('NFKD').replace(/[\u0300-\u036f]/g, '').toLowerCase(); }

  var texts = cards.map(function (card) { return plain(card.textContent + ' ' + card.getAttribute('data-search')); });

  function search() {
    var words = plain(box.value).split(/\s+/).filter(Boolean), shown = 0;
    cards.forEach(function (card, i) {
      card.hidden = !words.every(function (word) { return texts[i].indexOf(word) >= 0; });
      shown += card.hidden ? 0 : 1;
    });
    groups.forEach(function (group) {
      var any = [].some.call(group.querySelectorAll('.card'), function (card) { return !card.hidden; });
      group.hidden = !any;
      [].forEach.call(group.querySelectorAll('.trend'), function (trend) { trend.hidden = words.length > 0; });
    });
    found.textContent = words.length ? shown + ' of ' + cards.length + ' shown' : '';
  }

  if (form && cards.length > 1) {
    form.hidden = false;
    form.addEventListener('submit', function (event) { event.preventDefault(); });
    box.addEventListener('input', search);
    box.addEventListener('keydown', function (event) { if (event.key === 'Escape') { box.value = ''; search(); } });
    if (box.value) { search(); }
  }

  var units = [['year', 365.25], ['month', 30.44], ['week', 7], ['day', 1]];
  var words = new Intl.RelativeTimeFormat('en', { numeric: 'auto' });
  [].forEach.call(document.querySelectorAll('time[data-age]'), function (time) {
    var days = (Date.now() - new Date(time.getAttribute('datetime') + 'T00:00:00Z')) / 864e5;
    var unit = units.filter(function (u) { return Math.abs(days) >= u[1]; })[0] || units[3];
    time.insertAdjacentText('afterend', ' (' + words.format(-Math.floor(days / unit[1]), unit[0]) + ')');
  });
}());
