//! Whatever is asked of a job and whatever becomes of its slices, in whatever order: what was answered
//! holds, its events have no gap, it ends once with one result, and both databases say the same of it.

use futures_util::future::join_all;
use proptest::prelude::*;

use super::*;

on_both! {
    no_ending_of_a_slice_contradicts_what_two_calls_were_answered,
}

/// Lives of the server that may end with a job before it fails.
const DEATH_LIMIT: u32 = 2;

/// What a client asks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Call {
    Cancel,
    Pause,
    Resume,
    Delete,
    Show,
}

const CALLS: [Call; 5] = [
    Call::Cancel,
    Call::Pause,
    Call::Resume,
    Call::Delete,
    Call::Show,
];

/// How a slice ends that its worker ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum SliceEnd {
    Succeeds,
    Fails,
    /// The worker stopped the run because the job was asked to stop.
    Stops,
    HandsOn {
        must: bool,
    },
}

const SLICE_ENDS: [SliceEnd; 5] = [
    SliceEnd::Succeeds,
    SliceEnd::Fails,
    SliceEnd::Stops,
    SliceEnd::HandsOn { must: false },
    SliceEnd::HandsOn { must: true },
];

/// What can happen to a job.
#[derive(Clone, Copy, Debug)]
enum Deed {
    Ask(Call),
    Begin,
    Record,
    End(SliceEnd),
    /// The server ends in order, and another begins.
    Reopen,
    /// The server is cut off, and another takes over.
    Kill,
}

/// What the newest answer to a client means for the job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Promise {
    Nothing,
    IsCancelled,
    IsPaused,
    GoesOn,
    IsDeleted,
}

impl Promise {
    /// Whether a job may be in a state.
    fn allows(self, status: Status) -> bool {
        match self {
            Promise::Nothing | Promise::GoesOn => {
                !matches!(status, Status::Paused | Status::Cancelled)
            }
            Promise::IsCancelled => matches!(status, Status::Running | Status::Cancelled),
            Promise::IsPaused => matches!(status, Status::Running | Status::Paused),
            Promise::IsDeleted => false,
        }
    }

    /// The state of a job whose slice has ended.
    fn after(self, end: SliceEnd) -> Status {
        match (self, end) {
            (_, SliceEnd::HandsOn { .. }) => Status::Running,
            (Promise::IsCancelled, _) => Status::Cancelled,
            (Promise::IsPaused, _) => Status::Paused,
            (_, SliceEnd::Succeeds) => Status::Succeeded,
            (_, SliceEnd::Fails) => Status::Failed,
            // A pause was taken back, so that the job goes on.
            (_, SliceEnd::Stops) => Status::Running,
        }
    }
}

/// What everybody can read of a job.
#[derive(Clone, Debug, PartialEq)]
struct Shown {
    status: Option<Status>,
    events: Vec<StoredEvent>,
    result: Option<StoredResult>,
}

/// A job, and what was promised of it.
struct Life {
    id: JobId,
    slices: Vec<Slice>,
    promise: Promise,
    /// What was shown when the job had ended.
    ended: Option<Shown>,
}

impl Life {
    async fn new(fixture: &Fixture) -> Self {
        Self {
            id: fixture.submit().await.id,
            slices: Vec::new(),
            promise: Promise::Nothing,
            ended: None,
        }
    }

    async fn shown(&self, store: &Store) -> Shown {
        let row = store.jobs().find(self.id).await.expect("a read");
        Shown {
            status: row.map(|row| row.status),
            events: store
                .events()
                .after(self.id, 0, 1000)
                .await
                .expect("events"),
            result: store.results().find(self.id).await.expect("a read"),
        }
    }

    async fn ask(&mut self, store: &Store, call: Call) {
        let before = self.shown(store).await.status;
        let answer = match call {
            Call::Cancel => store.jobs().cancel(self.id).await,
            Call::Pause => store.jobs().pause(self.id).await,
            Call::Resume => store.jobs().resume(self.id).await,
            Call::Delete => return self.delete(store, before).await,
            Call::Show => return,
        };
        let promised = match call {
            Call::Cancel => Promise::IsCancelled,
            Call::Pause => Promise::IsPaused,
            _ => Promise::GoesOn,
        };
        match answer.expect("an answer") {
            Control::Accepted(row) => {
                assert!(promised.allows(row.status), "{call:?}: {row:?}");
                let was_cancelled = self.promise == Promise::IsCancelled;
                assert!(!was_cancelled || call == Call::Cancel, "{call:?}: {row:?}");
                self.promise = promised;
            }
            Control::Refused(status) => {
                let was_cancelled = self.promise == Promise::IsCancelled;
                let reason = match was_cancelled {
                    true => Some(Status::Cancelled),
                    false => before.filter(|before| before.is_terminal()),
                };
                assert_eq!(Some(status), reason, "{call:?}");
            }
            Control::NotFound => assert_eq!(self.promise, Promise::IsDeleted),
        }
    }

    async fn delete(&mut self, store: &Store, before: Option<Status>) {
        let removal = store.jobs().delete(self.id).await.expect("an answer");
        let expected = match before {
            None => JobRemoval::NotFound,
            Some(status) if status.is_terminal() => JobRemoval::Removed,
            Some(status) => JobRemoval::Unfinished(status),
        };
        assert_eq!(removal, expected);
        if removal == JobRemoval::Removed {
            self.promise = Promise::IsDeleted;
        }
    }

    async fn begin(&mut self, store: &Store) {
        let begun = store.slices().begin(self.id, None, DEATH_LIMIT).await;
        if let Begin::Slice(slice) = begun.expect("a start") {
            self.slices.push(*slice);
        }
    }

    async fn record(&self, store: &Store) {
        for slice in &self.slices {
            let record = Record {
                events: vec![Event::Generation(generation(1))],
                ..Record::default()
            };
            let hold = store.slices().record(slice.lease, record).await;
            let newest = self.slices.last().map(|newest| newest.lease);
            let kept = hold.expect("a write") == Hold::Kept;
            assert!(!kept || newest == Some(slice.lease));
        }
    }

    async fn has_ended_unless(&mut self, is_lost: bool, store: &Store, end: SliceEnd) {
        if !is_lost {
            self.has_ended(store, end).await;
        }
    }

    /// Ends all slices that were begun, the newest last.
    async fn end(&mut self, store: &Store, end: SliceEnd) {
        let record = Record {
            checkpoint: Some(Checkpoint {
                state: b"state".to_vec(),
                refinements: 0,
            }),
            worked_ms: 3,
            ..Record::default()
        };
        for slice in std::mem::take(&mut self.slices) {
            let (lease, record) = (slice.lease, record.clone());
            let ending = match end {
                SliceEnd::Succeeds => Ending::Succeeded(outcome(StopReason::GenerationLimit)),
                SliceEnd::Fails => Ending::Failed(Failure::no_estimate()),
                SliceEnd::Stops => Ending::Stopped(Some(outcome(StopReason::Paused))),
                SliceEnd::HandsOn { must } => {
                    let handed_on = store.slices().hand_on(lease, record, must).await;
                    let is_lost = handed_on.expect("a write") == HandedOn::Lost;
                    self.has_ended_unless(is_lost, store, end).await;
                    continue;
                }
            };
            let hold = store.slices().finish(lease, record, ending).await;
            let is_lost = hold.expect("a write") == Hold::Lost;
            self.has_ended_unless(is_lost, store, end).await;
        }
    }

    /// Lives through a moment of a plan: the first call, the second call, or the end of the slice.
    async fn live(&mut self, store: &Store, plan: &Plan, moment: u32) {
        match (moment, plan.end) {
            (0, _) => self.ask(store, plan.first).await,
            (1, _) => self.ask(store, plan.second).await,
            (_, Some(end)) => self.end(store, end).await,
            (_, None) => {}
        }
    }

    /// Checks the state in which the newest slice left the job.
    async fn has_ended(&self, store: &Store, end: SliceEnd) {
        let status = self.shown(store).await.status;
        let expected = self.promise.after(end);
        assert_eq!(status, Some(expected), "{end:?} after {:?}", self.promise);
    }

    /// Checks what everybody can read now.
    async fn check(&mut self, store: &Store) {
        let shown = self.shown(store).await;
        let Some(status) = shown.status else {
            assert_eq!(self.promise, Promise::IsDeleted);
            assert!(shown.events.is_empty() && shown.result.is_none());
            return;
        };
        assert!(self.promise.allows(status), "{:?}: {status}", self.promise);
        let all = 1..=i64::try_from(shown.events.len()).expect("few");
        assert_eq!(ids(&shown.events), all.collect::<Vec<_>>());
        let number = |name: &str| {
            names(&shown.events)
                .iter()
                .filter(|own| **own == name)
                .count()
        };
        assert!(number("result") <= 1, "{:?}", shown.events);
        assert_eq!(number("end"), usize::from(status.is_terminal()));
        let result = shown.result.as_ref();
        let reason = result.map(|result| result.outcome().expect("a result").stop_reason);
        match status {
            Status::Succeeded => assert_eq!(reason, Some(StopReason::GenerationLimit)),
            Status::Cancelled => assert!(reason.is_none_or(|why| why == StopReason::Cancelled)),
            _ => assert!(reason.is_none_or(|why| why == StopReason::Paused)),
        }
        if status.is_terminal() {
            let end = format!(r#"{{"status":"{status}"}}"#);
            let (last, before) = shown.events.split_last().expect("events");
            assert!(last.is_last() && last.data == end);
            assert_eq!(before.last().map(|event| &event.data), Some(&end));
            let ended = self.ended.get_or_insert_with(|| shown.clone());
            assert_eq!(*ended, shown, "a job that has ended stays as it is");
        }
    }
}

/// What happens to a job between the beginning of its first slice and its end.
struct Plan {
    first: Call,
    second: Call,
    /// Nothing where the server goes down with the job until that is held against the job.
    end: Option<SliceEnd>,
}

fn plans() -> Vec<Plan> {
    let mut plans = Vec::new();
    for first in CALLS {
        for second in CALLS {
            let ends = SLICE_ENDS.map(Some).into_iter().chain([None]);
            plans.extend(ends.map(|end| Plan { first, second, end }));
        }
    }
    plans
}

/// Begins a slice of every job.
async fn begin_all(store: &Store, lives: &mut [Life]) {
    let begun = lives.iter_mut().map(async |life| {
        life.begin(store).await;
        life.check(store).await;
    });
    join_all(begun).await;
}

/// Cuts the server off, and has the next begin a slice of every job.
async fn kill(fixture: Fixture, lives: &mut [Life]) -> Fixture {
    let fixture = fixture.cut_off().await;
    lives.iter_mut().for_each(|life| life.slices.clear());
    begin_all(&fixture.store, lives).await;
    fixture
}

async fn no_ending_of_a_slice_contradicts_what_two_calls_were_answered(mut fixture: Fixture) {
    /// The first call, the second call and the end of the slice; a kill may come before each.
    const MOMENTS: u32 = 3;
    let plans = plans();
    for kills in 0..1_u32 << MOMENTS {
        let mut lives = join_all(plans.iter().map(|_| Life::new(&fixture))).await;
        begin_all(&fixture.store, &mut lives).await;
        for moment in 0..MOMENTS {
            if kills & 1 << moment != 0 {
                fixture = kill(fixture, &mut lives).await;
            }
            let store = &fixture.store;
            let done = lives.iter_mut().zip(&plans).map(async |(life, plan)| {
                life.live(store, plan, moment).await;
                life.check(store).await;
            });
            join_all(done).await;
        }
        for _ in 0..=DEATH_LIMIT {
            fixture = kill(fixture, &mut lives).await;
        }
        for life in &mut lives {
            let status = life.shown(&fixture.store).await.status;
            assert_ne!(status, Some(Status::Running), "{:?}", life.promise);
        }
    }
}

fn deeds() -> impl Strategy<Value = Vec<Deed>> {
    let deed = prop_oneof![
        4 => proptest::sample::select(CALLS.to_vec()).prop_map(Deed::Ask),
        3 => proptest::sample::select(SLICE_ENDS.to_vec()).prop_map(Deed::End),
        4 => Just(Deed::Begin),
        2 => Just(Deed::Record),
        1 => Just(Deed::Reopen),
        1 => Just(Deed::Kill),
    ];
    proptest::collection::vec(deed, 1..25)
}

/// Lives a life, and answers what is shown in the end.
async fn live(mut fixture: Fixture, deeds: Vec<Deed>) -> Shown {
    let mut life = Life::new(&fixture).await;
    for deed in deeds {
        match deed {
            Deed::Ask(call) => life.ask(&fixture.store, call).await,
            Deed::Begin => life.begin(&fixture.store).await,
            Deed::Record => life.record(&fixture.store).await,
            Deed::End(end) => life.end(&fixture.store, end).await,
            Deed::Reopen => {
                life.slices.clear();
                fixture = fixture.reopen().await;
            }
            Deed::Kill => {
                life.slices.clear();
                fixture = fixture.cut_off().await;
            }
        }
        life.check(&fixture.store).await;
    }
    life.shown(&fixture.store).await
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn in_any_life_what_was_answered_holds_on_both_databases(deeds in deeds()) {
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .expect("a runtime");
        let (lived, lived_again) = runtime.block_on(async {
            let again = match Fixture::on_postgres().await {
                Some(fixture) => Some(live(fixture, deeds.clone()).await),
                None => None,
            };
            (live(Fixture::new().await, deeds).await, again)
        });
        if let Some(again) = lived_again {
            prop_assert_eq!(again, lived, "the two databases differ");
        }
    }
}
