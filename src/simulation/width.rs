//! Which vector registers code over lanes is compiled for, and the choice among them at run time.

/// The vector registers that code over lanes is compiled for, always some that this machine has.
/// All give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(Registers);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Registers {
    /// What every processor of this architecture has.
    Baseline,
    /// AVX2: four numbers in a register.
    #[cfg(target_arch = "x86_64")]
    Avx2,
}

impl Width {
    /// What every processor of this architecture has.
    pub const BASELINE: Width = Width(Registers::Baseline);

    /// The widest that this machine has.
    #[must_use]
    #[inline]
    pub fn widest() -> Width {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            return Width(Registers::Avx2);
        }
        Width::BASELINE
    }

    /// Does work with these registers.
    #[inline]
    pub fn does<W: Wide>(self, work: W) -> W::Output {
        match self.0 {
            Registers::Baseline => work.work(),
            #[cfg(target_arch = "x86_64")]
            Registers::Avx2 => {
                // SAFETY: only `Width::widest` makes this one, where the processor has it.
                #[expect(unsafe_code, reason = "run-time dispatch over vector widths")]
                unsafe {
                    work_avx2(work)
                }
            }
        }
    }
}

/// Work over rows of lanes that gains by wide registers. All of it that matters must be inlined
/// into [`Wide::work`], for only then is it compiled for them.
pub trait Wide {
    /// What comes of it.
    type Output;
    /// Does it.
    fn work(self) -> Self::Output;
}

/// Does work with the widest registers of this machine; the bits are those of any width.
#[inline]
pub fn at_full_width<W: Wide>(work: W) -> W::Output {
    Width::widest().does(work)
}

/// The same code, compiled for registers of four numbers.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn work_avx2<W: Wide>(work: W) -> W::Output {
    work.work()
}
