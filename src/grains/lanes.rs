//! Numbers in lanes: one formula for one contact, or for eight at once.
//!
//! Every operation is `+ - * / √` on each lane by itself, correctly rounded and never fused. A pair thus gets the same bits whatever its
//! neighbours, the number of lanes or the machine. Processors with AVX are detected at run time, so one program serves all.
//!
//! Code in lanes is always inlined and has no closures. A closure that is used twice becomes a function without wide registers, and each of
//! its operations a call. `nothing_in_wide_registers_is_called` in `tests/law/registers.rs` detects such calls.

#![expect(unsafe_code, reason = "vector registers, behind types that only AVX code makes")]
#![expect(clippy::inline_always, reason = "a vector stays in registers only if nothing is called")]

use std::cell::Cell;
use std::fmt::Debug;
use std::ops::{Add, Div, Mul, Sub};

/// One number, or several that are computed alike.
pub trait Lanes:
    Copy
    + Debug
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
{
    /// The given number in every lane.
    fn all(number: f64) -> Self;

    /// Square root of each lane.
    #[must_use]
    fn sqrt(self) -> Self;

    /// Mask of the lanes that are less than those of `other`; unset where one is NaN.
    fn less(self, other: Self) -> u8;

    /// Mask of the lanes that are less than or equal to those of `other`; unset where one is NaN.
    fn at_most(self, other: Self) -> u8;

    /// This number in lanes whose bit of `mask` is set, that of `other` elsewhere.
    #[must_use]
    fn or(self, other: Self, mask: u8) -> Self;
}

impl Lanes for f64 {
    #[inline(always)]
    fn all(number: f64) -> Self {
        number
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn less(self, other: Self) -> u8 {
        u8::from(self < other)
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> u8 {
        u8::from(self <= other)
    }

    #[inline(always)]
    fn or(self, other: Self, mask: u8) -> Self {
        if mask & 1 == 1 { self } else { other }
    }
}

/// Work in eight lanes, executed with the widest registers of the processor.
pub trait Kernel: Sized {
    /// A type of the module for which the code is compiled: compilers divide work by modules.
    type Home;

    /// Executes the work. To be inlined always, like everything below it that has lanes.
    fn run<L: Eight>(self);
}

/// Executes a kernel with the widest registers allowed.
pub fn dispatch<K: Kernel>(kernel: K) {
    match Registers::widest() {
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the processor has AVX-512, also for shorter registers.
        Registers::Avx512 => unsafe { K::Home::run_with_avx512(kernel) },
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the processor has AVX.
        Registers::Avx => unsafe { K::Home::run_with_avx(kernel) },
        _ => K::Home::run_anywhere(kernel),
    }
}

/// Vector registers of processors, from narrow to wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Registers {
    /// Registers that every processor has.
    Any,
    /// Four numbers.
    Avx,
    /// Eight numbers.
    Avx512,
}

thread_local! {
    static WIDEST: Cell<Registers> = Cell::new(Registers::of_processor().min(Registers::allowed()));
}

impl Registers {
    /// Widest registers of this processor.
    pub fn of_processor() -> Self {
        #[cfg(target_arch = "x86_64")]
        {
            if std::arch::is_x86_feature_detected!("avx512f")
                && std::arch::is_x86_feature_detected!("avx512vl")
                && std::arch::is_x86_feature_detected!("avx512dq")
            {
                return Self::Avx512;
            }
            if std::arch::is_x86_feature_detected!("avx") {
                return Self::Avx;
            }
        }
        Self::Any
    }

    /// Widest registers that `DEM_MPI_REGISTERS` allows, for comparison with other processors.
    fn allowed() -> Self {
        match std::env::var("DEM_MPI_REGISTERS").as_deref() {
            Ok("any") => Self::Any,
            Ok("avx") => Self::Avx,
            Ok("avx512") | Err(_) => Self::Avx512,
            Ok(other) => panic!("DEM_MPI_REGISTERS = {other}: there are any, avx and avx512"),
        }
    }

    /// Widest registers that kernels of this thread use.
    pub fn widest() -> Self {
        WIDEST.get()
    }

    /// Runs a function with these registers as the widest.
    pub fn at_most<T>(self, run: impl FnOnce() -> T) -> T {
        let before = WIDEST.replace(self.min(Self::of_processor()));
        let done = run();
        WIDEST.set(before);
        done
    }
}

/// Kernels are compiled in the module of the type `Self`, as methods of this trait.
trait Home {
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx512f,avx512vl,avx512dq")]
    unsafe fn run_with_avx512(kernel: impl Kernel) {
        kernel.run::<avx512::Avx512>();
    }

    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx")]
    unsafe fn run_with_avx(kernel: impl Kernel) {
        kernel.run::<avx::Avx>();
    }

    fn run_anywhere(kernel: impl Kernel) {
        kernel.run::<Portable>();
    }
}

impl<T> Home for T {}

/// Prefetches memory that will be read soon.
#[inline]
pub fn prefetch<T>(soon: &[T]) {
    #[cfg(target_arch = "x86_64")]
    for line in (0..size_of_val(soon)).step_by(64) {
        // SAFETY: the address is within the slice, and nothing is read.
        unsafe {
            let place = soon.as_ptr().cast::<i8>().add(line);
            std::arch::x86_64::_mm_prefetch::<{ std::arch::x86_64::_MM_HINT_T1 }>(place);
        }
    }
}

/// Number of pairs computed at once.
pub const WIDTH: usize = 8;

/// Four numbers before they are written to memory.
pub trait Row: Copy + Debug {
    /// Writes the numbers.
    fn write(self, to: &mut [f64; 4]);

    /// Adds the numbers to a sum.
    fn add_to(self, sum: &mut [f64; 4]);

    /// Copy with the opposite sign of the first three.
    #[must_use]
    fn opposite(self) -> Self;

    /// The four numbers.
    #[inline(always)]
    fn numbers(self) -> [f64; 4] {
        let mut numbers = [0.0; 4];
        self.write(&mut numbers);
        numbers
    }

    /// The first three numbers.
    #[inline(always)]
    fn first_three(self) -> [f64; 3] {
        let [x, y, z, _] = self.numbers();
        [x, y, z]
    }
}

impl Row for [f64; 4] {
    #[inline(always)]
    fn opposite(self) -> Self {
        let [x, y, z, w] = self;
        [-x, -y, -z, w]
    }

    #[inline(always)]
    fn write(self, to: &mut Self) {
        *to = self;
    }

    #[inline(always)]
    fn add_to(self, sum: &mut Self) {
        for (sum, number) in sum.iter_mut().zip(self) {
            *sum += number;
        }
    }
}

/// Eight lanes.
pub trait Eight: Lanes {
    /// A row made by [`Eight::rows_of_4`]. It stays in a register, because reading whole what was written in halves is slow.
    type Row: Row;

    /// Loads numbers from memory.
    fn load(numbers: &[f64; WIDTH]) -> Self;

    /// The numbers of all lanes.
    fn store(self) -> [f64; WIDTH];

    /// Columns of eight rows anywhere in memory: lane `k` of each comes from row `k`.
    fn columns_of_3(rows: &[&[f64; 3]; WIDTH]) -> [Self; 3];

    /// Columns of eight rows of four.
    fn columns_of_4(rows: &[&[f64; 4]; WIDTH]) -> [Self; 4];

    /// Columns of eight rows of six.
    fn columns_of_6(rows: &[&[f64; 6]; WIDTH]) -> [Self; 6];

    /// Rows from columns, the inverse of [`Eight::columns_of_4`].
    fn rows_of_4(columns: [Self; 4]) -> [Self::Row; WIDTH];
}

/// Eight lanes without vector registers, or with those that every processor has.
///
/// Lanes are written one by one, which compiles faster than loops and closures.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Portable([f64; WIDTH]);

/// An expression for each lane, with its number as a constant.
macro_rules! each_lane {
    (|$lane:ident| $number:expr) => {
        [
            {
                const $lane: usize = 0;
                $number
            },
            {
                const $lane: usize = 1;
                $number
            },
            {
                const $lane: usize = 2;
                $number
            },
            {
                const $lane: usize = 3;
                $number
            },
            {
                const $lane: usize = 4;
                $number
            },
            {
                const $lane: usize = 5;
                $number
            },
            {
                const $lane: usize = 6;
                $number
            },
            {
                const $lane: usize = 7;
                $number
            },
        ]
    };
}

macro_rules! lanewise {
    ($trait:ident, $method:ident, $operator:tt) => {
        impl $trait for Portable {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(each_lane!(|K| self.0[K] $operator other.0[K]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

/// Mask from one bit for each lane.
#[inline(always)]
fn mask([a, b, c, d, e, f, g, h]: [u8; WIDTH]) -> u8 {
    a | b << 1 | c << 2 | d << 3 | e << 4 | f << 5 | g << 6 | h << 7
}

impl Lanes for Portable {
    #[inline(always)]
    fn all(number: f64) -> Self {
        Self([number; WIDTH])
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(each_lane!(|K| self.0[K].sqrt()))
    }

    #[inline(always)]
    fn less(self, other: Self) -> u8 {
        mask(each_lane!(|K| u8::from(self.0[K] < other.0[K])))
    }

    #[inline(always)]
    fn at_most(self, other: Self) -> u8 {
        mask(each_lane!(|K| u8::from(self.0[K] <= other.0[K])))
    }

    #[inline(always)]
    fn or(self, other: Self, mask: u8) -> Self {
        Self(each_lane!(|K| if mask >> K & 1 == 1 { self.0[K] } else { other.0[K] }))
    }
}

impl Eight for Portable {
    type Row = [f64; 4];

    #[inline(always)]
    fn load(numbers: &[f64; WIDTH]) -> Self {
        Self(*numbers)
    }

    #[inline(always)]
    fn store(self) -> [f64; WIDTH] {
        self.0
    }

    #[inline(always)]
    fn columns_of_3(rows: &[&[f64; 3]; WIDTH]) -> [Self; 3] {
        [column(rows, 0), column(rows, 1), column(rows, 2)]
    }

    #[inline(always)]
    fn columns_of_4(rows: &[&[f64; 4]; WIDTH]) -> [Self; 4] {
        [column(rows, 0), column(rows, 1), column(rows, 2), column(rows, 3)]
    }

    #[inline(always)]
    fn columns_of_6(rows: &[&[f64; 6]; WIDTH]) -> [Self; 6] {
        let [a, b, c] = [column(rows, 0), column(rows, 1), column(rows, 2)];
        [a, b, c, column(rows, 3), column(rows, 4), column(rows, 5)]
    }

    #[inline(always)]
    fn rows_of_4([x, y, z, w]: [Self; 4]) -> [[f64; 4]; WIDTH] {
        each_lane!(|K| [x.0[K], y.0[K], z.0[K], w.0[K]])
    }
}

#[inline(always)]
fn column<const N: usize>(rows: &[&[f64; N]; WIDTH], at: usize) -> Portable {
    Portable(each_lane!(|K| rows[K][at]))
}

#[cfg(target_arch = "x86_64")]
mod avx512 {
    use super::avx::{AvxRow, four, three};
    use super::{Eight, Lanes, WIDTH};
    use std::arch::x86_64 as intel;
    use std::ops::{Add, Div, Mul, Sub};

    /// Eight lanes in one AVX-512 register.
    ///
    /// A value exists only on a processor with AVX-512: only functions that are compiled for it make one.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Avx512(intel::__m512d);

    impl Avx512 {
        /// Two rows of four side by side.
        #[inline(always)]
        fn of(low: intel::__m256d, high: intel::__m256d) -> Self {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe {
                let low = intel::_mm512_castpd256_pd512(low);
                Self(intel::_mm512_insertf64x4::<1>(low, high))
            }
        }

        /// Columns of eight rows of four: first those of two rows, then of four and four.
        #[inline(always)]
        fn columns(rows: [intel::__m256d; WIDTH]) -> [Self; 4] {
            let [a, b, c, d, e, f, g, h] = rows;
            let (ac, bd, eg, fh) =
                (Self::of(a, c).0, Self::of(b, d).0, Self::of(e, g).0, Self::of(f, h).0);
            // SAFETY: the processor has AVX-512, see the type.
            unsafe {
                let even = (intel::_mm512_unpacklo_pd(ac, bd), intel::_mm512_unpacklo_pd(eg, fh));
                let odd = (intel::_mm512_unpackhi_pd(ac, bd), intel::_mm512_unpackhi_pd(eg, fh));
                [
                    Self(intel::_mm512_shuffle_f64x2::<0b10_00_10_00>(even.0, even.1)),
                    Self(intel::_mm512_shuffle_f64x2::<0b10_00_10_00>(odd.0, odd.1)),
                    Self(intel::_mm512_shuffle_f64x2::<0b11_01_11_01>(even.0, even.1)),
                    Self(intel::_mm512_shuffle_f64x2::<0b11_01_11_01>(odd.0, odd.1)),
                ]
            }
        }

        /// The two rows side by side in the register.
        #[inline(always)]
        fn rows(self) -> [AvxRow; 2] {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe {
                [
                    AvxRow::of(intel::_mm512_castpd512_pd256(self.0)),
                    AvxRow::of(intel::_mm512_extractf64x4_pd::<1>(self.0)),
                ]
            }
        }
    }

    /// Four numbers of each row.
    #[inline(always)]
    fn eight_fours<const N: usize>(
        rows: &[&[f64; N]; WIDTH],
        at: usize,
    ) -> [intel::__m256d; WIDTH] {
        let [a, b, c, d, e, f, g, h] = rows;
        [
            four(a, at),
            four(b, at),
            four(c, at),
            four(d, at),
            four(e, at),
            four(f, at),
            four(g, at),
            four(h, at),
        ]
    }

    macro_rules! registerwise {
        ($trait:ident, $method:ident, $instruction:ident) => {
            impl $trait for Avx512 {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: the processor has AVX-512, see the type.
                    unsafe { Self(intel::$instruction(self.0, other.0)) }
                }
            }
        };
    }
    registerwise!(Add, add, _mm512_add_pd);
    registerwise!(Sub, sub, _mm512_sub_pd);
    registerwise!(Mul, mul, _mm512_mul_pd);
    registerwise!(Div, div, _mm512_div_pd);

    impl Lanes for Avx512 {
        #[inline(always)]
        fn all(number: f64) -> Self {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe { Self(intel::_mm512_set1_pd(number)) }
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe { Self(intel::_mm512_sqrt_pd(self.0)) }
        }

        #[inline(always)]
        fn less(self, other: Self) -> u8 {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe { intel::_mm512_cmp_pd_mask::<{ intel::_CMP_LT_OQ }>(self.0, other.0) }
        }

        #[inline(always)]
        fn at_most(self, other: Self) -> u8 {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe { intel::_mm512_cmp_pd_mask::<{ intel::_CMP_LE_OQ }>(self.0, other.0) }
        }

        #[inline(always)]
        fn or(self, other: Self, mask: u8) -> Self {
            // SAFETY: the processor has AVX-512, see the type.
            unsafe { Self(intel::_mm512_mask_blend_pd(mask, other.0, self.0)) }
        }
    }

    impl Eight for Avx512 {
        type Row = AvxRow;

        #[inline(always)]
        fn load(numbers: &[f64; WIDTH]) -> Self {
            // SAFETY: the processor has AVX-512, see the type; the array holds eight numbers.
            unsafe { Self(intel::_mm512_loadu_pd(numbers.as_ptr())) }
        }

        #[inline(always)]
        fn store(self) -> [f64; WIDTH] {
            // SAFETY: the register is eight numbers.
            unsafe { std::mem::transmute(self.0) }
        }

        #[inline(always)]
        fn columns_of_3(rows: &[&[f64; 3]; WIDTH]) -> [Self; 3] {
            let [a, b, c, d, e, f, g, h] = rows;
            let [x, y, z, _] = Self::columns([
                three(a),
                three(b),
                three(c),
                three(d),
                three(e),
                three(f),
                three(g),
                three(h),
            ]);
            [x, y, z]
        }

        #[inline(always)]
        fn columns_of_4(rows: &[&[f64; 4]; WIDTH]) -> [Self; 4] {
            Self::columns(eight_fours(rows, 0))
        }

        #[inline(always)]
        fn columns_of_6(rows: &[&[f64; 6]; WIDTH]) -> [Self; 6] {
            let [xx, yy, zz, xy] = Self::columns(eight_fours(rows, 0));
            let [_, _, xz, yz] = Self::columns(eight_fours(rows, 2));
            [xx, yy, zz, xy, xz, yz]
        }

        #[inline(always)]
        fn rows_of_4([x, y, z, w]: [Self; 4]) -> [AvxRow; WIDTH] {
            // SAFETY: the processor has AVX-512, see the type.
            let [[a, c], [e, g], [b, d], [f, h]] = unsafe {
                let (xy, zw) =
                    (intel::_mm512_unpacklo_pd(x.0, y.0), intel::_mm512_unpacklo_pd(z.0, w.0));
                let (xy_odd, zw_odd) =
                    (intel::_mm512_unpackhi_pd(x.0, y.0), intel::_mm512_unpackhi_pd(z.0, w.0));
                let first = intel::_mm512_setr_epi64(0, 1, 8, 9, 2, 3, 10, 11);
                let second = intel::_mm512_setr_epi64(4, 5, 12, 13, 6, 7, 14, 15);
                [
                    Self(intel::_mm512_permutex2var_pd(xy, first, zw)).rows(),
                    Self(intel::_mm512_permutex2var_pd(xy, second, zw)).rows(),
                    Self(intel::_mm512_permutex2var_pd(xy_odd, first, zw_odd)).rows(),
                    Self(intel::_mm512_permutex2var_pd(xy_odd, second, zw_odd)).rows(),
                ]
            };
            [a, b, c, d, e, f, g, h]
        }
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use super::{Eight, Lanes, Row, WIDTH};
    use std::arch::x86_64 as intel;
    use std::ops::{Add, Div, Mul, Sub};

    /// Eight lanes in two AVX registers.
    ///
    /// A value exists only on a processor with AVX: only functions that are compiled for it make one.
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct Avx(intel::__m256d, intel::__m256d);

    /// Lane masks of 64 bits for each mask of four bits.
    static CHOICES: [[u64; 4]; 16] = {
        let mut choices = [[0; 4]; 16];
        let mut mask = 0;
        while mask < 16 {
            let mut lane = 0;
            while lane < 4 {
                choices[mask][lane] = if mask >> lane & 1 == 1 { u64::MAX } else { 0 };
                lane += 1;
            }
            mask += 1;
        }
        choices
    };

    impl Avx {
        #[inline(always)]
        fn compare<const HOW: i32>(self, other: Self) -> u8 {
            // SAFETY: the processor has AVX, see the type.
            let (low, high) = unsafe {
                (
                    intel::_mm256_movemask_pd(intel::_mm256_cmp_pd::<HOW>(self.0, other.0)),
                    intel::_mm256_movemask_pd(intel::_mm256_cmp_pd::<HOW>(self.1, other.1)),
                )
            };
            (low | (high << 4)) as u8
        }
    }

    macro_rules! registerwise {
        ($trait:ident, $method:ident, $instruction:ident) => {
            impl $trait for Avx {
                type Output = Self;

                #[inline(always)]
                fn $method(self, other: Self) -> Self {
                    // SAFETY: the processor has AVX, see the type.
                    unsafe {
                        Self(
                            intel::$instruction(self.0, other.0),
                            intel::$instruction(self.1, other.1),
                        )
                    }
                }
            }
        };
    }
    registerwise!(Add, add, _mm256_add_pd);
    registerwise!(Sub, sub, _mm256_sub_pd);
    registerwise!(Mul, mul, _mm256_mul_pd);
    registerwise!(Div, div, _mm256_div_pd);

    impl Lanes for Avx {
        #[inline(always)]
        fn all(number: f64) -> Self {
            // SAFETY: the processor has AVX, see the type.
            unsafe { Self(intel::_mm256_set1_pd(number), intel::_mm256_set1_pd(number)) }
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: the processor has AVX, see the type.
            unsafe { Self(intel::_mm256_sqrt_pd(self.0), intel::_mm256_sqrt_pd(self.1)) }
        }

        #[inline(always)]
        fn less(self, other: Self) -> u8 {
            self.compare::<{ intel::_CMP_LT_OQ }>(other)
        }

        #[inline(always)]
        fn at_most(self, other: Self) -> u8 {
            self.compare::<{ intel::_CMP_LE_OQ }>(other)
        }

        #[inline(always)]
        fn or(self, other: Self, mask: u8) -> Self {
            let [low, high] = [mask & 15, mask >> 4].map(usize::from);
            // SAFETY: the processor has AVX, see the type; the tables hold four numbers a row.
            unsafe {
                let low = intel::_mm256_loadu_pd(CHOICES[low].as_ptr().cast());
                let high = intel::_mm256_loadu_pd(CHOICES[high].as_ptr().cast());
                Self(
                    intel::_mm256_blendv_pd(other.0, self.0, low),
                    intel::_mm256_blendv_pd(other.1, self.1, high),
                )
            }
        }
    }

    impl Eight for Avx {
        type Row = AvxRow;

        #[inline(always)]
        fn load(numbers: &[f64; WIDTH]) -> Self {
            let start = numbers.as_ptr();
            // SAFETY: the processor has AVX, see the type; the array holds twice four numbers.
            unsafe { Self(intel::_mm256_loadu_pd(start), intel::_mm256_loadu_pd(start.add(4))) }
        }

        #[inline(always)]
        fn store(self) -> [f64; WIDTH] {
            // SAFETY: each register is four numbers.
            unsafe { std::mem::transmute([self.0, self.1]) }
        }

        #[inline(always)]
        fn columns_of_3(rows: &[&[f64; 3]; WIDTH]) -> [Self; 3] {
            let [[x, y, z], [u, v, w]] = [four_of_3(rows, 0), four_of_3(rows, 4)];
            [Self(x, u), Self(y, v), Self(z, w)]
        }

        #[inline(always)]
        fn columns_of_4(rows: &[&[f64; 4]; WIDTH]) -> [Self; 4] {
            let [a, b, c, d] = four_of_4(rows, 0);
            let [p, q, r, s] = four_of_4(rows, 4);
            [Self(a, p), Self(b, q), Self(c, r), Self(d, s)]
        }

        #[inline(always)]
        fn columns_of_6(rows: &[&[f64; 6]; WIDTH]) -> [Self; 6] {
            let [a, b, c, d, e, f] = four_of_6(rows, 0);
            let [p, q, r, s, t, u] = four_of_6(rows, 4);
            [Self(a, p), Self(b, q), Self(c, r), Self(d, s), Self(e, t), Self(f, u)]
        }

        #[inline(always)]
        fn rows_of_4([x, y, z, w]: [Self; 4]) -> [AvxRow; WIDTH] {
            let [a, b, c, d] = rows_of_four(x.0, y.0, z.0, w.0);
            let [e, f, g, h] = rows_of_four(x.1, y.1, z.1, w.1);
            [a, b, c, d, e, f, g, h]
        }
    }

    /// Four rows from four columns.
    #[inline(always)]
    fn rows_of_four(
        x: intel::__m256d,
        y: intel::__m256d,
        z: intel::__m256d,
        w: intel::__m256d,
    ) -> [AvxRow; 4] {
        // SAFETY: the processor has AVX, see the type.
        unsafe {
            let (xy_02, xy_13) = (intel::_mm256_unpacklo_pd(x, y), intel::_mm256_unpackhi_pd(x, y));
            let (zw_02, zw_13) = (intel::_mm256_unpacklo_pd(z, w), intel::_mm256_unpackhi_pd(z, w));
            [
                AvxRow(intel::_mm256_permute2f128_pd::<0x20>(xy_02, zw_02)),
                AvxRow(intel::_mm256_permute2f128_pd::<0x20>(xy_13, zw_13)),
                AvxRow(intel::_mm256_permute2f128_pd::<0x31>(xy_02, zw_02)),
                AvxRow(intel::_mm256_permute2f128_pd::<0x31>(xy_13, zw_13)),
            ]
        }
    }

    /// Four numbers in an AVX register; it exists under the same condition as [`Avx`].
    #[derive(Clone, Copy, Debug)]
    pub(crate) struct AvxRow(intel::__m256d);

    impl AvxRow {
        #[inline(always)]
        pub(super) fn of(row: intel::__m256d) -> Self {
            Self(row)
        }
    }

    impl Row for AvxRow {
        #[inline(always)]
        fn opposite(self) -> Self {
            // SAFETY: the processor has AVX, see the type.
            unsafe {
                let signs = intel::_mm256_setr_pd(-0.0, -0.0, -0.0, 0.0);
                Self(intel::_mm256_xor_pd(self.0, signs))
            }
        }

        #[inline(always)]
        fn write(self, to: &mut [f64; 4]) {
            // SAFETY: the processor has AVX, see the type; the row holds four numbers.
            unsafe { intel::_mm256_storeu_pd(to.as_mut_ptr(), self.0) };
        }

        #[inline(always)]
        fn add_to(self, sum: &mut [f64; 4]) {
            // SAFETY: the processor has AVX, see the type; the row holds four numbers.
            unsafe {
                let total = intel::_mm256_add_pd(intel::_mm256_loadu_pd(sum.as_ptr()), self.0);
                intel::_mm256_storeu_pd(sum.as_mut_ptr(), total);
            }
        }
    }

    /// Columns of four rows from `first` on.
    ///
    /// Numbers go from memory to registers once and change places there. Written one by one into arrays, they would have to reach memory before
    /// they could be loaded again.
    #[inline(always)]
    fn four_of_3(rows: &[&[f64; 3]; WIDTH], first: usize) -> [intel::__m256d; 3] {
        // SAFETY: the processor has AVX, see the type; rows hold three numbers.
        unsafe {
            let a = three(rows[first]);
            let b = three(rows[first + 1]);
            let c = three(rows[first + 2]);
            let d = three(rows[first + 3]);
            let (ab, cd) = (intel::_mm256_unpacklo_pd(a, b), intel::_mm256_unpacklo_pd(c, d));
            let (y_ab, y_cd) = (intel::_mm256_unpackhi_pd(a, b), intel::_mm256_unpackhi_pd(c, d));
            [
                intel::_mm256_permute2f128_pd::<0x20>(ab, cd),
                intel::_mm256_permute2f128_pd::<0x20>(y_ab, y_cd),
                intel::_mm256_permute2f128_pd::<0x31>(ab, cd),
            ]
        }
    }

    /// Three numbers, and a zero.
    #[inline(always)]
    pub(super) fn three(row: &[f64; 3]) -> intel::__m256d {
        // SAFETY: the processor has AVX, see the type; the row holds three numbers, and no more are read.
        unsafe {
            let three = intel::_mm256_setr_epi64x(-1, -1, -1, 0);
            intel::_mm256_maskload_pd(row.as_ptr(), three)
        }
    }

    /// Four numbers of a row.
    #[inline(always)]
    pub(super) fn four<const N: usize>(row: &[f64; N], at: usize) -> intel::__m256d {
        let four = row[at..].first_chunk::<4>().expect("a row of four numbers or more");
        // SAFETY: the processor has AVX, see the type; four numbers are read.
        unsafe { intel::_mm256_loadu_pd(four.as_ptr()) }
    }

    /// Columns of the first four numbers of four rows from `first` on.
    #[inline(always)]
    fn four_of_4<const N: usize>(rows: &[&[f64; N]; WIDTH], first: usize) -> [intel::__m256d; 4] {
        const { assert!(N >= 4) };
        // SAFETY: the processor has AVX, see the type; rows hold four numbers.
        unsafe {
            let (a, b) = (four(rows[first], 0), four(rows[first + 1], 0));
            let (c, d) = (four(rows[first + 2], 0), four(rows[first + 3], 0));
            let (even_ab, odd_ab) =
                (intel::_mm256_unpacklo_pd(a, b), intel::_mm256_unpackhi_pd(a, b));
            let (even_cd, odd_cd) =
                (intel::_mm256_unpacklo_pd(c, d), intel::_mm256_unpackhi_pd(c, d));
            [
                intel::_mm256_permute2f128_pd::<0x20>(even_ab, even_cd),
                intel::_mm256_permute2f128_pd::<0x20>(odd_ab, odd_cd),
                intel::_mm256_permute2f128_pd::<0x31>(even_ab, even_cd),
                intel::_mm256_permute2f128_pd::<0x31>(odd_ab, odd_cd),
            ]
        }
    }

    /// Columns of four rows of six from `first` on.
    #[inline(always)]
    fn four_of_6(rows: &[&[f64; 6]; WIDTH], first: usize) -> [intel::__m256d; 6] {
        let [xx, yy, zz, xy] = four_of_4(rows, first);
        // SAFETY: the processor has AVX, see the type; rows hold six numbers.
        unsafe {
            let row = [0, 1, 2, 3].map(|k| rows[first + k].as_ptr());
            let a = intel::_mm256_castpd128_pd256(intel::_mm_loadu_pd(row[0].add(4)));
            let b = intel::_mm256_castpd128_pd256(intel::_mm_loadu_pd(row[1].add(4)));
            let ac = intel::_mm256_insertf128_pd::<1>(a, intel::_mm_loadu_pd(row[2].add(4)));
            let bd = intel::_mm256_insertf128_pd::<1>(b, intel::_mm_loadu_pd(row[3].add(4)));
            let (xz, yz) = (intel::_mm256_unpacklo_pd(ac, bd), intel::_mm256_unpackhi_pd(ac, bd));
            [xx, yy, zz, xy, xz, yz]
        }
    }
}

/// Pairs of rows in columns of one length, checked once.
#[derive(Clone, Copy)]
pub struct RowPairs<'a> {
    rows: &'a [[u32; 2]],
    length: usize,
}

impl<'a> RowPairs<'a> {
    /// Pairs of these rows.
    ///
    /// # Panics
    /// If a row is beyond the length.
    #[inline(always)]
    pub fn new(rows: &'a [[u32; 2]], length: usize) -> Self {
        let mut largest = 0;
        for &row in rows.as_flattened() {
            largest = if row > largest { row } else { largest };
        }
        assert!(rows.is_empty() || (largest as usize) < length, "a row beyond the column");
        Self { rows, length }
    }

    /// Eight pairs from `first` on. If fewer are left, the last one is repeated, in the memory of `room`.
    #[inline(always)]
    pub fn eight(self, first: usize, room: &'a mut [[u32; 2]; WIDTH]) -> [Gather<'a>; 2] {
        let Self { rows, length } = self;
        let rows = if let Some(rows) = rows[first..].first_chunk::<WIDTH>() {
            rows
        } else {
            let last = rows.len() - 1;
            for (lane, row) in room.iter_mut().enumerate() {
                *row = rows[last.min(first + lane)];
            }
            room
        };
        [Gather { rows, end: 0, length }, Gather { rows, end: 1, length }]
    }

    /// Up to eight pairs at these places, in the memory of `room`; the other lanes repeat the first.
    ///
    /// # Panics
    /// If there are no places, or one is out of range.
    #[inline(always)]
    pub fn picked(self, places: &[u32], room: &'a mut [[u32; 2]; WIDTH]) -> [Gather<'a>; 2] {
        let Self { rows: all, length } = self;
        if places.len() < WIDTH {
            *room = [all[places[0] as usize]; WIDTH];
        }
        for (row, &place) in room.iter_mut().zip(places) {
            *row = all[place as usize];
        }
        let rows = &*room;
        [Gather { rows, end: 0, length }, Gather { rows, end: 1, length }]
    }
}

/// First or second rows of eight pairs, in columns of one length.
#[derive(Clone, Copy)]
pub struct Gather<'a> {
    rows: &'a [[u32; 2]; WIDTH],
    end: usize,
    length: usize,
}

impl Gather<'_> {
    /// Index of the row of a lane.
    #[inline(always)]
    pub fn at(self, lane: usize) -> usize {
        self.rows[lane][self.end] as usize
    }

    /// Rows of a column.
    ///
    /// # Panics
    /// If the column is shorter than the largest index.
    #[inline(always)]
    pub fn rows<T>(self, column: &[T]) -> [&T; WIDTH] {
        assert!(column.len() >= self.length, "a column that is too short");
        // SAFETY: all rows are below the length, which the column has.
        unsafe {
            [
                column.get_unchecked(self.at(0)),
                column.get_unchecked(self.at(1)),
                column.get_unchecked(self.at(2)),
                column.get_unchecked(self.at(3)),
                column.get_unchecked(self.at(4)),
                column.get_unchecked(self.at(5)),
                column.get_unchecked(self.at(6)),
                column.get_unchecked(self.at(7)),
            ]
        }
    }

    /// Adds rows to those of both ends of each lane, lane after lane.
    ///
    /// # Panics
    /// If the column is shorter than the checked length.
    #[inline(always)]
    pub fn add<R: Row>(ends: [Self; 2], rows: [&[R; WIDTH]; 2], column: &mut [[f64; 4]]) {
        assert!(column.len() >= ends[0].length.max(ends[1].length), "a column that is too short");
        let ([first, other], [of_first, of_other]) = (ends, rows);
        for lane in 0..WIDTH {
            // SAFETY: all rows are below the length, which the column has.
            of_first[lane].add_to(unsafe { column.get_unchecked_mut(first.at(lane)) });
            // SAFETY: as above, all rows are below the length.
            of_other[lane].add_to(unsafe { column.get_unchecked_mut(other.at(lane)) });
        }
    }

    /// Adds a number to those of both ends of each lane, lane after lane.
    ///
    /// # Panics
    /// If the column is shorter than the checked length.
    #[inline(always)]
    pub fn add_numbers(ends: [Self; 2], numbers: &[f64; WIDTH], column: &mut [f64]) {
        assert!(column.len() >= ends[0].length.max(ends[1].length), "a column that is too short");
        let [first, other] = ends;
        for (lane, number) in numbers.iter().enumerate() {
            // SAFETY: all rows are below the length, which the column has.
            *unsafe { column.get_unchecked_mut(first.at(lane)) } += number;
            // SAFETY: as above, all rows are below the length.
            *unsafe { column.get_unchecked_mut(other.at(lane)) } += number;
        }
    }
}

/// A vector of three components, or several that are computed alike.
#[derive(Clone, Copy, Debug)]
#[must_use]
pub struct Triple<L> {
    /// First component.
    pub x: L,
    /// Second component.
    pub y: L,
    /// Third component.
    pub z: L,
}

impl<L: Lanes> Triple<L> {
    /// Zero vector.
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = L::all(0.0);
        Self { x: zero, y: zero, z: zero }
    }

    /// Sum.
    #[inline(always)]
    pub fn plus(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }

    /// Difference.
    #[inline(always)]
    pub fn minus(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }

    /// Product with a number.
    #[inline(always)]
    pub fn times(self, factor: L) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }

    /// Product with the inverse of a number, which is faster than three divisions.
    #[inline(always)]
    pub fn over(self, divisor: L) -> Self {
        self.times(L::all(1.0) / divisor)
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// [`Lanes::or`] of each component.
    #[inline(always)]
    pub fn or(self, other: Self, mask: u8) -> Self {
        Self {
            x: self.x.or(other.x, mask),
            y: self.y.or(other.y, mask),
            z: self.z.or(other.z, mask),
        }
    }

    /// Vector of length one in this direction.
    #[inline(always)]
    pub fn unit(self) -> Self {
        self.times(L::all(1.0) / self.dot(self).sqrt())
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> L {
        (self.x * other.x + self.y * other.y) + self.z * other.z
    }
}

/// Vector of one lane from the result of [`Triple::store`].
#[inline(always)]
pub fn row([x, y, z]: &[[f64; WIDTH]; 3], lane: usize) -> [f64; 3] {
    [x[lane], y[lane], z[lane]]
}

/// A symmetric matrix.
#[derive(Clone, Copy)]
pub(crate) struct Symmetric<L> {
    pub(crate) xx: L,
    pub(crate) yy: L,
    pub(crate) zz: L,
    pub(crate) xy: L,
    pub(crate) xz: L,
    pub(crate) yz: L,
}

impl<L: Eight> Triple<L> {
    /// Loads eight vectors from memory.
    #[inline(always)]
    pub fn of(rows: &[&[f64; 3]; WIDTH]) -> Self {
        let [x, y, z] = L::columns_of_3(rows);
        Self { x, y, z }
    }

    /// Vectors from the first three numbers of each row.
    #[inline(always)]
    pub(crate) fn of_four(rows: &[&[f64; 4]; WIDTH]) -> Self {
        let [x, y, z, _] = L::columns_of_4(rows);
        Self { x, y, z }
    }

    /// The numbers of all lanes, by component.
    #[inline(always)]
    pub fn store(self) -> [[f64; WIDTH]; 3] {
        [self.x.store(), self.y.store(), self.z.store()]
    }

    /// Rows of each vector with a number behind it.
    #[inline(always)]
    pub fn rows(self, number: L) -> [L::Row; WIDTH] {
        L::rows_of_4([self.x, self.y, self.z, number])
    }
}

impl<L: Eight> Symmetric<L> {
    /// Loads eight matrices from memory: xx, yy, zz, xy, xz, yz.
    #[inline(always)]
    pub(crate) fn of(rows: &[&[f64; 6]; WIDTH]) -> Self {
        let [xx, yy, zz, xy, xz, yz] = L::columns_of_6(rows);
        Self { xx, yy, zz, xy, xz, yz }
    }
}

impl<L: Lanes> Symmetric<L> {
    /// Product with a number.
    #[inline(always)]
    pub(crate) fn scaled(&self, factor: L) -> Self {
        Self {
            xx: self.xx * factor,
            yy: self.yy * factor,
            zz: self.zz * factor,
            xy: self.xy * factor,
            xz: self.xz * factor,
            yz: self.yz * factor,
        }
    }

    /// Product with a vector.
    #[inline(always)]
    pub(crate) fn times(&self, v: Triple<L>) -> Triple<L> {
        Triple {
            x: (self.xx * v.x + self.xy * v.y) + self.xz * v.z,
            y: (self.xy * v.x + self.yy * v.y) + self.yz * v.z,
            z: (self.xz * v.x + self.yz * v.y) + self.zz * v.z,
        }
    }

    /// Sum of two matrices.
    #[inline(always)]
    pub(crate) fn plus(&self, other: &Self) -> Self {
        Self {
            xx: self.xx + other.xx,
            yy: self.yy + other.yy,
            zz: self.zz + other.zz,
            xy: self.xy + other.xy,
            xz: self.xz + other.xz,
            yz: self.yz + other.yz,
        }
    }

    /// Adjugate: the inverse times the determinant.
    #[inline(always)]
    pub(crate) fn adjugate(&self) -> Self {
        Self {
            xx: self.yy * self.zz - self.yz * self.yz,
            yy: self.xx * self.zz - self.xz * self.xz,
            zz: self.xx * self.yy - self.xy * self.xy,
            xy: self.xz * self.yz - self.xy * self.zz,
            xz: self.xy * self.yz - self.xz * self.yy,
            yz: self.xy * self.xz - self.yz * self.xx,
        }
    }
}
