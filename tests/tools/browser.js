// SPDX-License-Identifier: MIT
// Runs inside of a report, after its own script: uses the page and puts what it found in the page's place.
'use strict';
(async () => {
  let checks = 0;
  const expect = (what, holds) => { ++checks; if (!holds) problems.push('expected: ' + what); };
  const one = selector => document.querySelector(selector);
  const wait = milliseconds => new Promise(resolve => setTimeout(resolve, milliseconds));
  // not decode(), which never ends where nothing is drawn on a screen
  const loaded = async image => {
    for (let k = 0; k < 50 && !image.complete; ++k) await wait(20);
    return image.complete && image.naturalWidth > 1;
  };
  const use_film = async (film, charts) => {
    const scrub = one('#scrub'), label = one('#time'), choice = one('#choice'), play = one('#play');
    const cursor = () => [...document.querySelectorAll('.chart .now')].map(line => line.getAttribute('x1')).join();
    const shown = () => ({image: film.src, text: label.textContent, cursor: cursor(), place: Number(scrub.value)});
    const last = Number(scrub.max);

    // the address asked for the second picture
    expect('the picture of the address', shown().place === 1);
    const slide = place => { scrub.value = place; scrub.dispatchEvent(new Event('input')); };
    slide(0);
    const first = shown();
    slide(Math.floor(last / 2));
    const middle = shown();
    expect('another picture after sliding', middle.image !== first.image);
    expect('another label after sliding', middle.text !== first.text);
    expect('other cursors in charts after sliding', middle.cursor !== first.cursor);
    expect('a film with pixels', await loaded(film) && film.getBoundingClientRect().height > 50);

    const press = (key, target = document.body) =>
        target.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true, cancelable: true}));
    press('ArrowRight');
    expect('the next picture by the right arrow', shown().place === middle.place + 1 && shown().image !== middle.image);
    press('ArrowLeft', choice);
    expect('the picture before by the left arrow', shown().place === middle.place && shown().image === middle.image);
    slide(0);
    press('ArrowLeft');
    expect('no picture before the first', shown().place === 0);

    play.click();
    expect('a button to pause', play.textContent === 'Pause');
    await wait(1500);
    play.click();
    const paused = shown();
    expect('a film that plays', paused.place > 0);
    await wait(1500);
    expect('a film that pauses', shown().place === paused.place && play.textContent === 'Play');

    const box = charts[0].getBoundingClientRect();
    const middle_of_chart = {clientX: box.left + 0.7 * box.width, clientY: box.top + 20, buttons: 1};
    charts[0].dispatchEvent(new PointerEvent('pointerdown', middle_of_chart));
    expect('the time that was clicked', Math.abs(shown().place / last - 0.65) < 0.2);

    if (choice.options.length > 1) {
      slide(Math.floor(0.6 * last));
      const before = shown();
      choice.selectedIndex = choice.options.length - 1;
      choice.dispatchEvent(new Event('change'));
      expect('another film', shown().image !== before.image && shown().place === before.place);
      const strong = document.querySelectorAll('.strong');
      expect('stronger lines of the chosen film', strong.length > 0 &&
             [...strong].every(line => line.dataset.name === choice.value));
      const links = document.querySelectorAll('a[href^="#film="]');
      expect('pictures that lead to the film', links.length >= choice.options.length);
      links[0].click();
      await wait(100);
      const wish = new URLSearchParams(links[0].hash.slice(1));
      expect('the film of the link', choice.selectedIndex === Number(wish.get('film')) &&
             shown().place === Number(wish.get('picture')));
    }
  };
  try {
    expect('a table with cells', document.querySelectorAll('td').length > 3);
    const charts = [...document.querySelectorAll('.chart')].filter(chart => chart.getBoundingClientRect().width > 0);
    expect('charts that are visible', charts.length > 0);
    for (const chart of charts) {
      const lines = [...chart.querySelectorAll('path.line')];
      const bars = [...chart.querySelectorAll('rect[fill]')];
      expect('lines or bars in "' + chart.getAttribute('aria-label') + '"',
             lines.some(line => line.getTotalLength() > 50) || bars.some(bar => bar.height.baseVal.value > 20));
      const box = chart.getBoundingClientRect();
      expect('a chart no wider than the page', box.left >= 0 && box.right <= document.documentElement.clientWidth);
      expect('letters that can be read', parseFloat(getComputedStyle(chart).fontSize) * box.width /
                                             chart.viewBox.baseVal.width > 9);
    }
    expect('a page that need not be pushed sideways',
           document.documentElement.scrollWidth <= document.documentElement.clientWidth);
    for (const image of document.images) expect('pixels in each picture', await loaded(image));

    // the address says whether there is a film to see
    const film = one('#film');
    expect('a film if there is one to see', Boolean(film) === location.hash.includes('film='));
    if (film) await use_film(film, charts);
  } catch (error) {
    problems.push(String(error.stack || error));
  }
  // short, so that the dump holds this alone
  const result = document.createElement('pre');
  result.textContent = checks + ' checks, ' + problems.length + ' problems\n' + problems.join('\n');
  document.body.replaceChildren(result);
})();
