/* Loaded before the platform's mathematics (LD_PRELOAD): its functions, each off by 1e-9 of its value, so that every digit that
   depends on them shows. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <math.h>

#define FUNCTION(name, parameters, arguments)                                    \
    double name parameters {                                                     \
        static double (*real) parameters;                                        \
        if (!real) real = (double (*) parameters)dlsym(RTLD_NEXT, #name);        \
        return (1 + 1e-9) * real arguments;                                      \
    }
#define OF_ONE(name) FUNCTION(name, (double x), (x))
#define OF_TWO(name) FUNCTION(name, (double x, double y), (x, y))

OF_ONE(acos) OF_ONE(asin) OF_ONE(atan) OF_ONE(cbrt) OF_ONE(cos) OF_ONE(cosh) OF_ONE(exp) OF_ONE(exp2) OF_ONE(expm1)
OF_ONE(log) OF_ONE(log10) OF_ONE(log1p) OF_ONE(log2) OF_ONE(sin) OF_ONE(sinh) OF_ONE(tan) OF_ONE(tanh)
OF_TWO(atan2) OF_TWO(hypot) OF_TWO(pow)

void sincos(double x, double *sine, double *cosine) {
    *sine = sin(x);
    *cosine = cos(x);
}
