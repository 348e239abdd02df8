//! Which vector registers code over lanes is compiled for, and the choice among them at run time.

/// The vector registers that code over lanes is compiled for, always some that this machine has.
/// All give the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Width(RegisterWidth);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum RegisterWidth {
    /// What every processor of this architecture has.
    Baseline,
    /// AVX2: 32 bytes in a register.
    #[cfg(target_arch = "x86_64")]
    Avx2,
    /// AVX-512: 64 bytes in a register, for work that gains by it.
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Width {
    /// What every processor of this architecture has.
    pub const BASELINE: Width = Width(RegisterWidth::Baseline);

    /// All that this machine has, the narrowest first.
    pub fn available() -> impl Iterator<Item = Width> {
        let wider = RegisterWidth::WIDER
            .into_iter()
            .filter(RegisterWidth::is_here);
        std::iter::once(Width::BASELINE).chain(wider.map(Width))
    }

    /// The widest that this machine has.
    #[must_use]
    #[inline]
    pub fn widest() -> Width {
        Width::available().last().unwrap_or(Width::BASELINE)
    }

    /// Does work with these registers.
    #[inline]
    pub fn does<W: Wide>(self, work: W) -> W::Output {
        match self.0 {
            RegisterWidth::Baseline => {
                if const { W::ON_BASELINE } {
                    work.work()
                } else {
                    unreachable!("this work is only done in wide registers")
                }
            }
            #[cfg(target_arch = "x86_64")]
            RegisterWidth::Avx512 if W::FILLS_64_BYTES => {
                // SAFETY: a `Width` is made of these only where the processor has them.
                #[expect(unsafe_code, reason = "run-time dispatch over vector widths")]
                unsafe {
                    work_avx512(work)
                }
            }
            #[cfg(target_arch = "x86_64")]
            RegisterWidth::Avx2 | RegisterWidth::Avx512 => {
                // SAFETY: as above; where there is AVX-512 there is AVX2.
                #[expect(unsafe_code, reason = "run-time dispatch over vector widths")]
                unsafe {
                    work_avx2(work)
                }
            }
        }
    }
}

impl RegisterWidth {
    /// The registers beyond the baseline, ascending.
    #[cfg(target_arch = "x86_64")]
    const WIDER: [RegisterWidth; 2] = [RegisterWidth::Avx2, RegisterWidth::Avx512];
    #[cfg(not(target_arch = "x86_64"))]
    const WIDER: [RegisterWidth; 0] = [];

    /// Whether this machine has the registers.
    #[inline]
    fn is_here(&self) -> bool {
        match self {
            RegisterWidth::Baseline => true,
            #[cfg(target_arch = "x86_64")]
            RegisterWidth::Avx2 => is_x86_feature_detected!("avx2"),
            // Processors from 2019 on; those before them lower their clock for such registers
            // (Intel Xeon Processor Scalable Family, Specification Update, 2017: turbo with AVX-512).
            #[cfg(target_arch = "x86_64")]
            RegisterWidth::Avx512 => {
                RegisterWidth::Avx2.is_here()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512dq")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512vbmi2")
            }
        }
    }
}

/// Work over rows of lanes that gains by wide registers. All of it that matters must be inlined
/// into [`Wide::work`], for only then is it compiled for them.
pub trait Wide {
    /// What the work returns.
    type Output;
    /// Whether the work gains by registers of 64 bytes. Sixteen numbers of single precision do, by a
    /// quarter of the time; eight of double precision were no faster in them (`benches/README.md`).
    const FILLS_64_BYTES: bool = false;
    /// Whether the work is done on machines without wide registers as well. Other work is not compiled
    /// for them.
    const ON_BASELINE: bool = true;
    /// Does the work.
    fn work(self) -> Self::Output;
}

/// Does work with the widest registers of this machine; the bits are those of any width.
#[inline]
pub fn at_full_width<W: Wide>(work: W) -> W::Output {
    Width::widest().does(work)
}

/// Does work, compiled for registers of 32 bytes.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn work_avx2<W: Wide>(work: W) -> W::Output {
    work.work()
}

/// Does work, compiled for registers of 64 bytes.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512dq,avx512vl")]
fn work_avx512<W: Wide>(work: W) -> W::Output {
    work.work()
}
