//! The paths of a row of pixels, sorted into blocks of [`LANES`] neighbours that share an axis.
//!
//! Pixels of a block take the grid lines of their major axis together: line o of each lies o pixels from it,
//! so that what they read stands side by side in memory. A block in which both axes occur makes a
//! record for either, in which the pixels of the other weigh nothing (and follow the path of one that does).
//!
//! Each record knows its lines in advance, hence how far apart its pixels are on each of them, and
//! the factor that makes the weights of a pixel sum to 1. Paths that bend by less than [`STRAIGHT`] are
//! straight, and where all of a block are, and go through their pixels, line -o mirrors line o.

use multiversion::multiversion;

use super::group::{Group, group};
use super::lanes::{GENTLE, LANES, Lanes, Parabola, Prepared, Taps};
use super::record::{Kind, Line, Record};
use super::strands::Strands;
use crate::flow_field::FlowField;
use crate::motion_path::MotionPaths;

/// Largest curvature q, px, of a path that is taken as straight: it leaves the line by an eighth of it.
const STRAIGHT: f32 = 0.1;
/// Shortest major motion, px: below, a pixel is still or, if it has an offset, moves so far.
const LEAST_MOTION: f32 = 0.02;
/// Longest major motion, px, that is always straight.
const SHORT: f32 = 1.0;
/// Largest major curvature as a share of the major motion: the slow end has a tenth of the mean speed. At 2 the path
/// would turn back.
const MOST_BEND: f32 = 1.8;

/// All records of a row of pixels.
#[derive(Debug, Clone, Default)]
pub(super) struct RowPlan {
    pub(super) records: Vec<Record>,
    /// Which of them, in this order, are swept as one; see `group.rs`.
    pub(super) groups: Vec<Group>,
    pub(super) lines: Vec<Line>,
    pub(super) lanes: Vec<Lanes>,
    /// Where what the groups scatter goes, if that is kept.
    pub(super) strands: Option<Strands>,
    /// Rows or columns from a pixel to what it reads, at most.
    pub(super) reach: usize,
}

/// The pixels of a block that belong to a record.
type Block = [Option<Parabola>; LANES];

impl RowPlan {
    /// The plan of row `y`.
    pub(super) fn new(paths: &MotionPaths, y: usize, taps: Taps) -> Self {
        let width = paths.dim().1;
        let row_of = |field: &FlowField<f32>| [field.u.row(y).to_vec(), field.v.row(y).to_vec()];
        let (motion, bend) = (row_of(&paths.velocity), row_of(&paths.curvature));
        let shift = paths.offset.as_ref().map(row_of);
        let mut plan = Self::default();
        for first in (0..width).step_by(LANES) {
            // The last block is moved back onto the picture; what the one before does is left out.
            let column = first.min(width.saturating_sub(LANES));
            let mut still = Lanes::ZERO;
            let mut moving: [Block; 2] = [[None; LANES]; 2];
            for x in first..(column + LANES).min(width) {
                let shift = shift.as_ref().map_or([0.0; 2], |[u, v]| [u[x], v[x]]);
                match path_of([motion[0][x], motion[1][x]], [bend[0][x], bend[1][x]], shift) {
                    None => still.0[x - column] = 1.0,
                    Some((path, down)) => moving[usize::from(down)][x - column] = Some(path),
                }
            }
            if still != Lanes::ZERO {
                let record = plan.record(column, Kind::Still, false);
                plan.records.push(record);
                plan.lanes.push(still);
            }
            for (block, down) in moving.iter().zip([false, true]) {
                plan.push_block(column, block, down, taps);
            }
        }
        plan.groups = group(&mut plan.records, &mut plan.lines, 2 * taps.reach() as u32);
        plan.groups.shrink_to_fit();
        plan.records.shrink_to_fit();
        plan.lines.shrink_to_fit();
        plan.lanes.shrink_to_fit();
        plan
    }

    /// The same, with the strands of all groups: found once where neighbours have the same lines.
    pub(super) fn with_strands(mut self, taps: Taps) -> Self {
        let (mut at, mut places, mut strands) = (0, Vec::new(), Strands::default());
        let mut last = None;
        for group in &mut self.groups {
            let lead = &self.records[at];
            at += usize::from(group.size);
            let still = lead.kind == Kind::Still;
            let shape = (still, group.first, group.lines, lead.down);
            group.strands = match last {
                Some((before, strands)) if before == shape => strands,
                _ if still => strands.find(&[[0, 0]]),
                _ => {
                    group.places(&self.lines, taps.reach(), lead.down, &mut places);
                    strands.find(&places)
                }
            };
            last = Some((shape, group.strands));
        }
        self.strands = Some(strands.compact());
        self
    }

    /// A record without lines.
    fn record(&self, column: usize, kind: Kind, down: bool) -> Record {
        Record {
            column: column as u32,
            kind,
            down,
            first: 0,
            count: 0,
            inner: [0; 2],
            lines: self.lines.len() as u32,
            lanes: self.lanes.len() as u32,
            planes: 1,
        }
    }

    /// Adds the record of the pixels of `block`, if any.
    fn push_block(&mut self, column: usize, block: &Block, down: bool, taps: Taps) {
        let Some(any) = block.iter().flatten().next().copied() else { return };
        let paths = block.map(|path| path.unwrap_or(any));
        let offset = paths.iter().any(|p| p.offset != [0.0; 2]);
        let kind = if paths.iter().any(|p| p.curvature[0].abs() > GENTLE * p.velocity[0]) {
            Kind::Curved
        } else if offset || paths.iter().any(|p| p.curvature != [0.0; 2]) {
            Kind::Gentle
        } else {
            Kind::Straight
        };
        let mut record = self.record(column, kind, down);
        set_lines(&mut record, &paths, taps.reach());
        let plane = |value: fn(&Parabola) -> f32| Lanes(paths.each_ref().map(value));
        self.lanes.push(Lanes(block.map(|path| f32::from(u8::from(path.is_some())))));
        self.lanes.extend([plane(|p| p.velocity[0]), plane(|p| p.velocity[1])]);
        if kind != Kind::Straight {
            self.lanes.extend([plane(|p| p.curvature[0]), plane(|p| p.curvature[1])]);
        }
        if offset {
            self.lanes.extend([plane(|p| p.offset[0]), plane(|p| p.offset[1])]);
        }
        record.planes = (self.lanes.len() - record.lanes as usize) as u8;
        let (before, lanes) = (self.lines.len(), record.lanes_of(&self.lanes));
        let sums = match taps {
            Taps::Linear => survey::<false>(&record, lanes, &mut self.lines),
            Taps::Cubic | Taps::Spline | Taps::ThriftySpline => {
                survey::<true>(&record, lanes, &mut self.lines)
            }
        };
        for (gain, sum) in self.lanes[record.lanes as usize].0.iter_mut().zip(sums.0) {
            *gain = if *gain > 0.0 { 1.0 / sum } else { 0.0 };
        }
        let ends = [record.first, record.first + record.count as i16 - 1];
        let across = self.lines[before..].iter().flat_map(|line| {
            let last = i32::from(line.floor) + i32::from(line.span) + 2;
            [last, i32::from(line.floor) - 1]
        });
        let farthest = across.chain(ends.map(i32::from)).map(i32::unsigned_abs).max();
        self.reach = self.reach.max(farthest.map_or(0, |z| z as usize));
        self.share(&mut record);
        self.records.push(record);
    }

    /// Lets a record whose lanes are those of the one before, and hence its lines, use them.
    fn share(&mut self, record: &mut Record) {
        let alike = |last: &&Record| last.kind == record.kind && last.planes == record.planes;
        let Some(last) = self.records.last().filter(alike) else { return };
        if last.lanes_of(&self.lanes) == record.lanes_of(&self.lanes) {
            self.lanes.truncate(record.lanes as usize);
            self.lines.truncate(record.lines as usize);
            (record.lanes, record.lines) = (last.lanes, last.lines);
        }
    }
}

/// The path of V = (u, v), q and d, and whether its major axis is the vertical one; None: still, or unknown.
fn path_of([u, v]: [f32; 2], bend: [f32; 2], shift: [f32; 2]) -> Option<(Parabola, bool)> {
    let down = v.abs() > u.abs();
    let order = |[x, y]: [f32; 2]| if down { [y, x] } else { [x, y] };
    let [a, b] = order([u, v]);
    if (a + b).is_nan() || (a.abs() < LEAST_MOTION && shift == [0.0; 2]) {
        return None;
    }
    // Back in time along -V is forth in time along V.
    let velocity =
        if a.abs() < LEAST_MOTION { [LEAST_MOTION, 0.0] } else { [a.abs(), b * a.signum()] };
    let mut curvature = [0.0; 2];
    if a.abs() > SHORT && bend.iter().any(|q| q.abs() > STRAIGHT) {
        let [qa, qb] = order(bend);
        let share = (MOST_BEND * a.abs() / qa.abs()).min(1.0);
        curvature = [share * qa, share * qb];
    }
    Some((Parabola { velocity, curvature, offset: order(shift) }, down))
}

/// Sets the lines that weigh anything, and those inside of all paths.
fn set_lines(record: &mut Record, paths: &[Parabola; LANES], reach: usize) {
    let (mut least, mut most) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    for path in paths {
        for (i, end) in path.ends().into_iter().enumerate() {
            let end = path.offset[0] + end;
            least[i] = if end < least[i] { end } else { least[i] };
            most[i] = if end > most[i] { end } else { most[i] };
        }
    }
    let reach = reach as f32;
    let first = (least[0] - reach).floor() as i16 + 1;
    let last = (most[1] + reach).ceil() as i16 - 1;
    record.inner = [(most[0] + reach).ceil() as i16, (least[1] - reach).floor() as i16 + 1];
    record.first = if record.kind == Kind::Straight { 0 } else { first };
    record.count = (last - record.first + 1) as u16;
}

/// Adds the lines of a record to `lines`; gives the sums of its weights.
#[multiversion(targets("x86_64+avx512f+avx512bw+avx512dq+avx512vl", "x86_64+avx2"))]
fn survey<const CUBIC: bool>(record: &Record, lanes: &[Lanes], lines: &mut Vec<Line>) -> Lanes {
    let mut sums = Lanes::ZERO;
    let prepared = Prepared::new::<CUBIC>(lanes);
    for i in 0..record.count {
        let [weight, minor] = line_of::<CUBIC>(record, &prepared, record.first + i as i16);
        let twice = if record.kind == Kind::Straight { 2.0 } else { 1.0 };
        let (mut least, mut most) = (minor.0[0], minor.0[0]);
        for lane in 0..LANES {
            sums.0[lane] += twice * weight.0[lane];
            least = if minor.0[lane] < least { minor.0[lane] } else { least };
            most = if minor.0[lane] > most { minor.0[lane] } else { most };
        }
        let floor = least.floor();
        lines.push(Line { floor: floor as i16, span: (most.floor() - floor) as u16 });
    }
    sums
}

/// Weights and minor positions of the pixels of a record that moves on one of its lines.
#[inline(always)]
pub(super) fn line_of<const CUBIC: bool>(
    record: &Record,
    paths: &Prepared,
    line: i16,
) -> [Lanes; 2] {
    let inner = record.inner[0] <= line && line < record.inner[1];
    let line = f32::from(line);
    match (record.kind, inner) {
        (Kind::Still | Kind::Straight, _) => paths.straight::<CUBIC>(line, inner),
        (Kind::Gentle, true) => paths.curved::<CUBIC, true, true>(line),
        (Kind::Gentle, false) => paths.curved::<CUBIC, false, true>(line),
        (Kind::Curved, true) => paths.curved::<CUBIC, true, false>(line),
        (Kind::Curved, false) => paths.curved::<CUBIC, false, false>(line),
    }
}
