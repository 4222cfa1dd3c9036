//! L4: particles that are born and die. Those of an emitter are neighbouring rows at the end of a system's columns; their
//! order means nothing, and changes when one dies: the last takes its place. So a birth or a death costs a few rows'
//! moves, however many there are.

mod emitter;

pub use emitter::{Birth, Course, Emitter, Kill, Near, Origin, Parent};

use crate::exchange::{Event, Exchange, Happening, Turn};
use crate::geometry::Vector;
use crate::math::parallel::{Tasks, chunks, fold};
use crate::math::{Real, Row, xyz64};
use crate::state::Object;
use crate::system::{Archive, Part};
use std::ops::Range;
use tumble_interface::scene::Cause;
use tumble_interface::{Column, Data, StepError};

/// Rows per task when looking for the dead.
const TASK: usize = 16_384;

/// The living particles of one emitter.
struct Stream {
    emitter: Emitter,
    /// How many live.
    len: usize,
    /// The id of the next.
    next: u64,
    /// Particles that the rate has made so far; a real number.
    flow: f64,
}

/// A particle that met a solid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// When [s].
    pub time: f64,
    /// Position [m].
    pub x: Vector,
    /// How fast it leaves [m/s].
    pub v: Vector,
    /// Out of the solid.
    pub normal: Vector,
}

/// A particle of a stream that bears a burst before its interval ends: one that made room for a newborn, or bounced.
struct Stirred {
    stream: usize,
    id: u32,
    death: Option<Cause>,
    parent: Parent,
}

/// The particles of all emitters of a system.
#[derive(Default)]
pub struct Pool {
    /// First of their rows.
    first: usize,
    streams: Vec<Stream>,
    /// Ids, unique within a stream, never used again.
    id: Vec<u32>,
    /// Ages at the end of the current exchange interval [s].
    age: Vec<Real>,
    /// Times of birth [s]; empty if nothing depends on them.
    born: Vec<f64>,
    /// Users' numbers, by name: one for each row, 0 where its stream has none.
    columns: Vec<(String, Vec<Real>)>,
    /// Length of the current exchange interval [s].
    interval: f64,
    /// Parents that made room or bounced in it.
    stirred: Vec<Stirred>,
    /// Of each emitter, whether other systems ask for its events, and if so, whether for contacts as well.
    heard: Vec<Option<bool>>,
    /// What other systems will hear: emitters and their events.
    told: Vec<(usize, Event)>,
    /// Of each emitter, parents in other systems.
    parents: Vec<Vec<Parent>>,
}

/// How columns change when rows come or go.
struct Arrange<'a> {
    /// Particles to keep room for.
    room: usize,
    /// Rows to move, in order: from and to.
    moves: &'a [(usize, usize)],
}

impl Arrange<'_> {
    /// A column that begins with row `first` has so many rows afterwards.
    fn apply<T: Copy + Default>(&self, column: &mut Vec<T>, rows: usize, first: usize) {
        if rows > column.len() {
            if rows > column.capacity() {
                column.reserve_exact(self.room.max(rows) - column.len());
            }
            column.resize(rows, T::default());
        }
        for (from, to) in self.moves {
            column[to - first] = column[from - first];
        }
        column.truncate(rows);
    }
}

/// Takes from the unborn, who stand in the order of their birth, those born by the time `until`; all of them at the `end`.
pub fn due(unborn: &mut Vec<Birth>, until: f64, end: f64) -> Vec<Birth> {
    let due = if until >= end { unborn.len() } else { unborn.partition_point(|b| b.time <= until) };
    unborn.drain(..due).collect()
}

/// The columns that move with the rows of a pool.
pub struct Columns<'a> {
    /// Columns of rows.
    pub rows: Vec<&'a mut Vec<Row>>,
    /// Columns of numbers.
    pub numbers: Vec<&'a mut Vec<Real>>,
}

impl Pool {
    /// No particles yet; theirs are the rows from `first` on.
    pub fn new(first: usize, emitters: Vec<Emitter>) -> Self {
        let mut columns: Vec<(String, Vec<Real>)> = Vec::new();
        for (name, _) in emitters.iter().flat_map(Emitter::columns) {
            if columns.iter().all(|(known, _)| known != name) {
                columns.push((name.clone(), Vec::new()));
            }
        }
        let streams = emitters.into_iter().map(|emitter| Stream { emitter, len: 0, next: 0, flow: 0.0 }).collect();
        Self { first, streams, columns, ..Self::default() }
    }

    /// How many emitters there are.
    pub fn len(&self) -> usize {
        self.streams.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.streams.is_empty()
    }

    /// An emitter.
    pub fn emitter(&self, s: usize) -> &Emitter {
        &self.streams[s].emitter
    }

    /// The rows of an emitter.
    pub fn rows(&self, s: usize) -> Range<usize> {
        let start = self.first + self.streams[..s].iter().map(|s| s.len).sum::<usize>();
        start..start + self.streams[s].len
    }

    /// Rows of everything, and the first that has none.
    pub fn end(&self) -> usize {
        self.first + self.id.len()
    }

    /// Id of the particle in a row, if it is one of a pool's.
    pub fn id_of(&self, row: usize) -> Option<u32> {
        self.id.get(row.checked_sub(self.first)?).copied()
    }

    /// Ids of the rows of an emitter.
    pub fn ids(&self, s: usize) -> &[u32] {
        let rows = self.rows(s);
        &self.id[rows.start - self.first..rows.end - self.first]
    }

    /// Their ages [s].
    pub fn ages(&self, s: usize) -> &[Real] {
        let rows = self.rows(s);
        &self.age[rows.start - self.first..rows.end - self.first]
    }

    /// When the particle k of an emitter was born [s]; 0 if nothing depends on it.
    fn born(&self, s: usize, k: usize) -> f64 {
        self.born.get(self.rows(s).start - self.first + k).copied().unwrap_or(0.0)
    }

    /// Whether anything depends on times of birth.
    fn heeds_births(&self) -> bool {
        self.streams.iter().any(|stream| stream.emitter.heeds_birth())
    }

    /// A column of users' numbers.
    pub fn column(&self, s: usize, name: &str) -> Option<&[Real]> {
        let rows = self.rows(s);
        let has = self.streams[s].emitter.columns().any(|(known, _)| known == name);
        let (_, column) = self.columns.iter().find(|(known, _)| has && known == name)?;
        Some(&column[rows.start - self.first..rows.end - self.first])
    }

    /// Ages everyone by dt [s]; returns the births of each emitter in (t, t + dt], children of particles left out, in order. `system` is
    /// the name of the pool's.
    pub fn schedule_births(&mut self, system: &str, t: f64, dt: f64) -> Result<Vec<Vec<Birth>>, StepError> {
        self.interval = dt;
        let older = dt as Real;
        chunks(&mut self.age, |_, ages| ages.iter_mut().for_each(|age| *age += older));
        (0..self.len()).map(|s| self.births(s, t, dt).ok_or_else(|| self.full(s, system, t))).collect()
    }

    fn full(&self, s: usize, system: &str, time: f64) -> StepError {
        StepError::Capacity { system: system.into(), time, what: self.emitter(s).full() }
    }

    /// `None` if the emitter is full and may not be, or has used up its ids.
    fn births(&mut self, s: usize, t: f64, dt: f64) -> Option<Vec<Birth>> {
        let Stream { emitter, len, next, flow } = &mut self.streams[s];
        let before = *flow;
        *flow = emitter.flow(before, t, dt);
        let births = match self.parents.get_mut(s).map(std::mem::take) {
            Some(parents) if !parents.is_empty() => emitter.bursts(&parents, *next, emitter.room(*len)?)?,
            _ => emitter.births((t, dt), (before, *flow), *next, emitter.room(*len)?)?,
        };
        *next += births.len() as u64;
        Some(births)
    }

    /// Hears which events are asked for, and what has happened to parents in other systems.
    pub fn listen(&mut self, exchange: &Exchange) {
        let Self { streams, heard, told, parents, .. } = self;
        // An interval may have been cut short.
        told.clear();
        heard.clear();
        heard.extend(streams.iter().map(|stream| exchange.is_heard(&stream.emitter.words().name)));
        parents.clear();
        parents.extend(streams.iter().map(|Stream { emitter, .. }| match &emitter.from {
            Origin::Elsewhere(object) => {
                let stirs = |event: &&Event| emitter.is_stirred_by(event.what);
                exchange.events(object).iter().filter(stirs).map(Parent::of).collect()
            }
            _ => Vec::new(),
        }));
    }

    /// Tells other systems what has happened in the interval.
    pub fn tell(&mut self, exchange: &mut Turn<'_>) {
        for s in (0..self.len()).filter(|s| self.heard.get(*s).is_some_and(Option::is_some)) {
            let events = self.told.iter().filter(|(stream, _)| *stream == s).map(|(_, event)| *event).collect();
            exchange.tell(&self.streams[s].emitter.words().name, events);
        }
        self.told.clear();
    }

    /// Children, by emitter, of the particles of emitter `parent`, in an interval that ends at t [s], while these live and when they die
    /// or bounce: `dead` are to leave. `system` is the name of the pool's.
    pub fn descendants(
        &mut self,
        parent: usize,
        system: &str,
        t: f64,
        dead: &[(u32, Cause)],
        (x, v): (&[Row], &[Row]),
    ) -> Result<Vec<(usize, Vec<Birth>)>, StepError> {
        if self.heard.get(parent).is_some_and(Option::is_some) {
            let events = self.events(parent, t, dead, x, v);
            self.told.extend(events.into_iter().map(|event| (parent, event)));
        }
        let children: Vec<usize> = (parent + 1..self.len()).filter(|child| self.parent(*child) == Some(parent)).collect();
        let born = |s: usize| Ok((s, self.children(s, parent, t, dead, x, v).ok_or_else(|| self.full(s, system, t))?));
        children.into_iter().map(born).collect()
    }

    fn children(&mut self, s: usize, parent: usize, t: f64, dead: &[(u32, Cause)], x: &[Row], v: &[Row]) -> Option<Vec<Birth>> {
        let mut births = Vec::new();
        if self.streams[s].emitter.has_rate() {
            let of =
                |k: usize| self.until(parent, k, f64::INFINITY, (t, t), x[self.rows(parent).start + k], v[self.rows(parent).start + k]);
            let mut parents: Vec<Parent> = fold(self.streams[parent].len, |range| range.map(of).collect::<Vec<_>>()).concat();
            parents.extend(self.stirred.iter().filter(|e| e.stream == parent && e.death.is_some()).map(|e| e.parent));
            let Stream { emitter, len, next, .. } = &mut self.streams[s];
            births = emitter.children(&parents, *next, emitter.room(*len)?)?;
            *next += births.len() as u64;
        }
        let parents = self.bearing(s, parent, t, dead, x, v);
        let Stream { emitter, len, next, .. } = &mut self.streams[s];
        let bursts = emitter.bursts(&parents, *next, emitter.room(*len + births.len())?)?;
        *next += bursts.len() as u64;
        births.extend(bursts);
        Some(births)
    }

    /// Tells the objects that are made of emitted particles which rows they have now.
    pub fn place(&self, objects: &mut [Object]) {
        for object in objects {
            if let Some(s) = object.stream {
                object.points = self.rows(s);
            }
        }
    }

    /// The emitter of the parents of an emitter.
    fn parent(&self, s: usize) -> Option<usize> {
        match self.streams[s].emitter.from {
            Origin::Particles(parent) => Some(parent),
            Origin::Place(_) | Origin::Elsewhere(_) => None,
        }
    }

    /// Makes rows for the newborn of an emitter, of which everything but `owned` is filled, and tells which.
    pub fn insert(&mut self, s: usize, births: &[Birth], t: f64, owned: Columns<'_>) -> Range<usize> {
        let (k, total) = (births.len(), self.id.len());
        let mut moves = Vec::new();
        for later in (s + 1..self.streams.len()).rev() {
            let rows = self.rows(later);
            let some = k.min(rows.len());
            let to = rows.end.max(rows.start + k);
            moves.extend((0..some).map(|i| (rows.start + i, to + i)));
        }
        let start = self.rows(s).end;
        self.resize(total + k, owned, &moves);
        self.streams[s].len += k;
        let Self { first, streams, id, age, born, columns, .. } = self;
        let emitter = &streams[s].emitter;
        for (i, birth) in births.iter().enumerate() {
            let row = start + i - *first;
            id[row] = birth.id;
            age[row] = (t - birth.time) as Real;
            born.get_mut(row).into_iter().for_each(|born| *born = birth.time);
        }
        for (name, column) in columns {
            for (i, birth) in births.iter().enumerate() {
                column[start + i - *first] = emitter.number(name, birth.id) as Real;
            }
        }
        start..start + k
    }

    /// Takes rows of an emitter away; `dead` counts from its first, in order.
    pub fn remove(&mut self, s: usize, dead: &[u32], owned: Columns<'_>) {
        if dead.is_empty() {
            return;
        }
        let rows = self.rows(s);
        let (d, left) = (dead.len(), rows.len() - dead.len());
        let holes = dead.iter().map(|i| *i as usize).take_while(|i| *i < left);
        // The dead at the end need no one to take their place, and take no one's.
        let mut tail = dead[dead.partition_point(|i| (*i as usize) < left)..].iter().map(|i| *i as usize).peekable();
        let fillers = (left..rows.len()).filter(|i| tail.next_if_eq(i).is_none());
        let mut moves: Vec<(usize, usize)> = holes.zip(fillers).map(|(hole, from)| (rows.start + from, rows.start + hole)).collect();
        for later in s + 1..self.streams.len() {
            let rows = self.rows(later);
            let some = d.min(rows.len());
            let (from, to) = if rows.len() >= d { (rows.end - d, rows.start - d) } else { (rows.start, rows.start - d) };
            moves.extend((0..some).map(|i| (from + i, to + i)));
        }
        let total = self.id.len() - d;
        self.resize(total, owned, &moves);
        self.streams[s].len = left;
    }

    /// Moves rows and cuts or lengthens every column; room is made before, and taken away after.
    fn resize(&mut self, total: usize, owned: Columns<'_>, moves: &[(usize, usize)]) {
        // Room for as many as are expected, and headroom beyond: memory that is not touched costs nothing.
        let expected: usize = self.streams.iter().map(|s| s.emitter.expected().min(s.emitter.most().unwrap_or(usize::MAX))).sum();
        let room = self.first + expected.min(1 << 30).max(total + total / 2);
        let arrange = Arrange { room, moves };
        let first = self.first;
        for column in owned.rows {
            arrange.apply(column, first + total, 0);
        }
        for column in owned.numbers {
            arrange.apply(column, first + total, 0);
        }
        arrange.apply(&mut self.id, total, first);
        arrange.apply(&mut self.age, total, first);
        if self.heeds_births() {
            arrange.apply(&mut self.born, total, first);
        }
        for (_, column) in &mut self.columns {
            arrange.apply(column, total, first);
        }
    }

    /// Particles of an emitter that die at time t, the end of an interval of length dt [s], with the cause; counted from its first row, in order. x
    /// and v are all rows of the system; `near` tells whether a point is near a collider.
    pub fn dead(&self, s: usize, t: (f64, f64), x: &[Row], v: &[Row], near: &Near<'_>) -> Vec<(u32, Cause)> {
        let (rows, emitter) = (self.rows(s), &self.streams[s].emitter);
        if emitter.is_immortal() {
            return Vec::new();
        }
        let (x, v, ids, ages) = (&x[rows.clone()], &v[rows], self.ids(s), self.ages(s));
        let tasks: Vec<Range<usize>> = (0..x.len()).step_by(TASK).map(|a| a..(a + TASK).min(x.len())).collect();
        let safe = emitter.safe_until(t.1);
        let dies = |i: usize| Some((i as u32, emitter.dies(t, (ids[i], self.born(s, i), f64::from(ages[i])), (x[i], v[i]), near)?));
        let among = |task: Range<usize>| -> Vec<(u32, Cause)> {
            let old = ages[task.clone()].iter().zip(task).filter(|(age, _)| f64::from(**age) >= safe);
            old.filter_map(|(_, i)| dies(i)).collect()
        };
        tasks.into_iter().map_in_parallel(among).concat()
    }

    /// The oldest of an emitter that have to make room for the newborn, if they may: each dies as the one is born that takes its
    /// room. The rows of x and v are as at the time `now` of an interval that ends at `end`.
    pub fn surplus(&mut self, s: usize, births: &[Birth], times: (f64, f64), x: &[Row], v: &dyn Fn(usize) -> Row) -> Vec<u32> {
        let stream = &self.streams[s];
        let most = stream.emitter.most().unwrap_or(usize::MAX);
        let over = (stream.len + births.len()).saturating_sub(most).min(stream.len);
        if over == 0 || !stream.emitter.replaces() {
            return Vec::new();
        }
        let (ids, ages) = (self.ids(s), self.ages(s));
        let mut all: Vec<u32> = (0..stream.len as u32).collect();
        let older = |a: &u32, b: &u32| {
            let (a, b) = (*a as usize, *b as usize);
            ages[b].total_cmp(&ages[a]).then(ids[a].cmp(&ids[b]))
        };
        if over < all.len() {
            all.select_nth_unstable_by(over - 1, older);
            all.truncate(over);
        }
        let heard = self.heard.get(s).is_some_and(Option::is_some);
        if heard || (0..self.len()).any(|child| self.parent(child) == Some(s)) {
            all.sort_unstable_by(older);
            let (room, start) = (most - stream.len, self.rows(s).start);
            let stirred = all.iter().zip(&births[room..]).map(|(k, birth)| {
                let (k, row) = (*k as usize, start + *k as usize);
                let parent = self.until(s, k, birth.time, times, x[row], v(row));
                Stirred { stream: s, id: ids[k], death: Some(Cause::Replaced), parent }
            });
            let stirred: Vec<Stirred> = stirred.collect();
            self.stirred.extend(stirred);
        }
        all.sort_unstable();
        all
    }

    /// Whether the bounces of an emitter's particles bear others, or are asked for.
    pub fn heeds_hits(&self, s: usize) -> bool {
        let bears = |child: usize| self.parent(child) == Some(s) && self.emitter(child).is_stirred_by(Happening::Contact);
        self.heard.get(s).is_some_and(|contacts| *contacts == Some(true)) || (0..self.len()).any(bears)
    }

    /// The rows of particles whose bounces bear others, or are asked for.
    pub fn heeded(&self) -> Vec<Range<usize>> {
        (0..self.len()).filter(|s| self.heeds_hits(*s)).map(|s| self.rows(s)).collect()
    }

    /// A particle in a row has met a solid.
    pub fn note_row(&mut self, row: usize, hit: Hit) {
        if let Some(s) = (0..self.len()).find(|s| self.rows(*s).contains(&row)) {
            let k = row - self.first;
            self.note(s, self.id[k], f64::from(self.age[k]), hit);
        }
    }

    /// A particle of an emitter, which will have this age [s] when the interval ends, has met a solid.
    pub fn note(&mut self, s: usize, id: u32, age: f64, hit: Hit) {
        let Hit { time, x, v, normal } = hit;
        self.stirred.push(Stirred { stream: s, id, death: None, parent: Parent { time, x, v, normal, age, before: 0.0 } });
    }

    /// The interval is over: everyone has borne.
    pub fn calm(&mut self) {
        self.stirred.clear();
    }

    /// Particle k of an emitter as a parent of others, with its row of x and v at the time `now` of an interval that ends at `end`:
    /// as it is then, or as it was when it died, at the latest at the time `last`.
    fn until(&self, s: usize, k: usize, last: f64, (now, end): (f64, f64), x: Row, v: Row) -> Parent {
        let age = f64::from(self.ages(s)[k]);
        let late = (age - self.streams[s].emitter.lifetime(self.ids(s)[k], self.born(s, k))).max(end - last).max(0.0);
        let v = xyz64(v);
        let ago = (late - (end - now)).max(0.0);
        Parent { time: end - late, x: xyz64(x) - v * ago, v, normal: v, age: age - late, before: age - self.interval }
    }

    /// Parents that bear bursts of an emitter, in the order of their death or bounce, where an interval ends at t.
    fn bearing(&self, child: usize, s: usize, t: f64, dead: &[(u32, Cause)], x: &[Row], v: &[Row]) -> Vec<Parent> {
        let emitter = &self.streams[child].emitter;
        self.events(s, t, dead, x, v).iter().filter(|event| emitter.is_stirred_by(event.what)).map(Parent::of).collect()
    }

    /// What has happened to the particles of an emitter in an interval that ends at t, in the order of times.
    fn events(&self, s: usize, t: f64, dead: &[(u32, Cause)], x: &[Row], v: &[Row]) -> Vec<Event> {
        let (emitter, start) = (&self.streams[s].emitter, self.rows(s).start);
        let died = dead.iter().map(|(k, cause)| {
            let (k, row) = (*k as usize, start + *k as usize);
            self.until(s, k, f64::INFINITY, (t, t), x[row], v[row]).event(self.ids(s)[k], Happening::Death(*cause))
        });
        // Whoever had died before it met the solid met none; its age is that at the end.
        let lived = |e: &&Stirred| e.death.is_some() || e.parent.age - (t - e.parent.time) <= emitter.lifetime(e.id, t - e.parent.age);
        let stirred = self.stirred.iter().filter(|e| e.stream == s).filter(lived);
        let stirred = stirred.map(|e| e.parent.event(e.id, e.death.map_or(Happening::Contact, Happening::Death)));
        let mut all: Vec<Event> = died.chain(stirred).collect();
        all.sort_by(|a, b| a.time.total_cmp(&b.time).then(a.id.cmp(&b.id)));
        all
    }

    /// The columns that only emitted particles have. `mass` are the masses of all rows, where there are any.
    pub fn write(&self, s: usize, object: &str, mass: &[Real], out: &mut Vec<Column>) {
        let (ids, ages, emitter) = (self.ids(s), self.ages(s), self.emitter(s));
        let mut add = |name: &str, data| out.push(Column::new(object, name, data));
        add("id", Data::U32(ids.to_vec()));
        add("age", Data::from(ages.to_vec()));
        if emitter.has_radii() {
            add(
                "radius",
                Data::from(ids.iter().enumerate().map(|(k, id)| emitter.radius(*id, self.born(s, k)) as Real).collect::<Vec<Real>>()),
            );
        }
        if let (true, Some(mass)) = (emitter.has_masses(), mass.get(self.rows(s))) {
            add("mass", Data::from(mass.to_vec()));
        }
        if emitter.has_colors() {
            let color = |(k, (id, age)): (usize, (&u32, &Real))| emitter.color(*id, self.born(s, k), f64::from(*age)).unwrap_or_default();
            let colors = ids.iter().zip(ages).enumerate().flat_map(color);
            add("color", Data::from(colors.map(|c| c as Real).collect::<Vec<Real>>()));
        }
        for (name, _) in emitter.columns() {
            add(name, Data::from(self.column(s, name).unwrap_or_default().to_vec()));
        }
    }

    /// Writes everything that the next births and deaths depend on.
    pub fn save(&self, archive: &mut Archive) {
        let counts = self.streams.iter().flat_map(|s| [s.len as f64, s.next as f64, s.flow]);
        archive.push("pool", Part::Numbers(counts.collect()));
        archive.push_indices("id", &self.id);
        archive.push_numbers("age", &self.age);
        if self.heeds_births() {
            archive.push("born", Part::Numbers(self.born.clone()));
        }
        for (name, column) in &self.columns {
            archive.push_numbers(name, column);
        }
    }

    /// Reads it back; `None` if it is not of this pool.
    pub fn restore(&mut self, archive: &mut Archive) -> Option<()> {
        let counts = archive.numbers("pool")?;
        if counts.len() != 3 * self.streams.len() {
            return None;
        }
        for (stream, counts) in self.streams.iter_mut().zip(counts.chunks_exact(3)) {
            (stream.len, stream.next, stream.flow) = (counts[0] as usize, counts[1] as u64, counts[2]);
        }
        let total = self.streams.iter().try_fold(0_usize, |sum, s| sum.checked_add(s.len))?;
        self.stirred.clear();
        self.id = archive.indices("id")?;
        archive.column("age", &mut self.age)?;
        if self.heeds_births() {
            self.born = archive.numbers("born").filter(|born| born.len() == total)?;
        }
        let mut fits = self.id.len() == total && self.age.len() == total && self.age.iter().all(|age| age.is_finite());
        for (name, column) in &mut self.columns {
            archive.column(name, column)?;
            fits &= column.len() == total;
        }
        fits.then_some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Sampler, Vector};
    use tumble_interface::Scene;

    /// Three emitters in a row; x[0] of every particle is told by its emitter and id, so that one that went astray shows.
    #[test]
    fn rows_keep_their_particles() {
        let text = "version = 1\n[[emitter]]\nname = \"a\"\nfrom.point = {}\n[[emitter]]\nname = \"b\"\nfrom.point = {}\ncolumns = { heat = { from = 0, to = 1 } }\n\
                    [[emitter]]\nname = \"c\"\nfrom.point = {}\n";
        let words = Scene::from_toml(text).unwrap().emitter;
        let make = |w: &tumble_interface::scene::Emitter| {
            let course = Course {
                rate: 0.0.into(),
                velocity: [0.0; 3].into(),
                speed: 0.0.into(),
                cone: 0.0.into(),
                path: [0.0; 3].into(),
                lifetime: None,
                radius: 0.01.into(),
                colors: [None, None, None],
                end: 1.0,
            };
            Emitter::new(w.clone(), course, 1, Origin::Place(Sampler::Point(Vector::default())), Vec::new(), [0.0, 0.0, 1.0].into(), None)
        };
        let mut pool = Pool::new(5, words.iter().map(make).collect());
        let (mut x, mut mass): (Vec<Row>, Vec<Real>) = (vec![[-1.0; 4]; 5], vec![-1.0; 5]);
        let mut living: [Vec<u32>; 3] = Default::default();
        let mut next = [0_u32; 3];
        let draw = crate::math::Random::new(3, "rows");
        for round in 0..400 {
            let [which, what, many, _] = draw.uniform(round, 0, 0);
            let s = (which * 3.0) as usize;
            if what < 0.55 {
                let k = (many * many * 60.0) as u32;
                let births: Vec<Birth> =
                    (0..k).map(|i| Birth { time: 0.0, x: Vector::default(), v: Vector::default(), id: next[s] + i }).collect();
                let rows = pool.insert(s, &births, 0.0, Columns { rows: vec![&mut x], numbers: vec![&mut mass] });
                assert_eq!(rows.len(), births.len());
                for (row, birth) in rows.zip(&births) {
                    (x[row], mass[row]) = ([(s as u32 * 100_000 + birth.id) as Real; 4], birth.id as Real);
                }
                living[s].extend(next[s]..next[s] + k);
                next[s] += k;
            } else {
                let dead: Vec<u32> = (0..living[s].len() as u32).filter(|i| draw.uniform(round, 1 + i, 0)[0] < many * many).collect();
                let gone: Vec<u32> = dead.iter().map(|i| pool.ids(s)[*i as usize]).collect();
                pool.remove(s, &dead, Columns { rows: vec![&mut x], numbers: vec![&mut mass] });
                living[s].retain(|id| !gone.contains(id));
            }
            assert_eq!(x.len(), pool.end());
            assert!(x[..5].iter().all(|x| x[0] == -1.0));
            for s in 0..3 {
                let mut ids = pool.ids(s).to_vec();
                for (row, id) in pool.rows(s).zip(&ids) {
                    assert_eq!((x[row][0], mass[row]), ((s as u32 * 100_000 + id) as Real, *id as Real), "round {round}");
                }
                let heat = pool.column(1, "heat").unwrap();
                assert!(heat.iter().zip(pool.ids(1)).all(|(h, id)| *h == pool.emitter(1).number("heat", *id) as Real));
                ids.sort_unstable();
                assert_eq!(ids, living[s], "round {round}");
            }
        }
        assert!(next.iter().all(|n| *n > 300) && pool.end() > 50, "{next:?}");
    }
}
