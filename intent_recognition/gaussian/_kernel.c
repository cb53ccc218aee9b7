/* SPDX-License-Identifier: Apache-2.0
 *
 * Conditions n Gaussians over the weights w of P DOFs with N basis functions each on one measurement y = H w + e,
 * together with the phase deviation of each, which takes E values (E = 1: the plain update, Maeda et al. 2014, Eq. 6).
 * `batch.py` calls this, and has the same update in numpy. Each covariance is read once and written once.
 *
 * A row of the state holds the D = P N means and then the upper triangle of the covariance, line by line. Four lines at
 * a time begin at the same column and end at a multiple of four, so that they can be handled together.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <math.h>
#include <string.h>

#define INLINE static inline __attribute__((always_inline))
#define FETCH(address) __builtin_prefetch(address, 0, 2) /* into L2: L1 has too few buffers for pending loads */

typedef Py_ssize_t Size;
typedef double Four __attribute__((vector_size(32), aligned(8), may_alias)); /* extension of GCC and Clang */
#define four(at) (*(const Four *)(at))
typedef struct {
    Size n_rows, n, P, N, m, E, D, columns, width; /* columns: D, rounded up to four */
    double *state, *deviation, *density, *likelihood, *scratch;
    const double *transition, *rows, *values, *noise;
    const int64_t *index, *dofs;
    Size values_step, noise_step; /* 0 if all Gaussians share the values or the noise */
    double exponent, freedom, constant;
} Work;

/* Offset of line a of the covariance, counted from the end of the means; its first column is a, rounded down to four. */
INLINE Size line_at(Size columns, Size a) {
    Size block = a / 4;
    return 4 * block * columns - 8 * block * (block - 1) + (a % 4) * (columns - 4 * block);
}
INLINE const double *line(const double *upper, Size columns, Size a) { return upper + line_at(columns, a) - a / 4 * 4; }

INLINE double dot(Size n, const double *a, const double *b) {
    double sum = 0.0;
#pragma omp simd reduction(+ : sum)
    for (Size k = 0; k < n; k++) sum += a[k] * b[k];
    return sum;
}

/* Add to out = h C the terms of `count` lines from a on: the stored elements, and their mirror images below them. */
INLINE void project_lines(Size columns, Size count, Size a, const double *c, const double *h, Size first, Size last,
                          double *restrict out) {
    Size length = columns - a, begin = a + 4 > first / 4 * 4 ? a + 4 : first / 4 * 4;
    if (a < last && a + count > first)
        for (Size b = 0; b < length; b += 4) {
            Four sum = four(out + a + b);
            for (Size k = 0; k < count; k++) sum += h[a + k] * four(c + k * length + b);
            *(Four *)(out + a + b) = sum;
        }
    if (begin >= last) return;
    Four sums[4] = {{0.0}, {0.0}, {0.0}, {0.0}};
    for (Size b = begin; b < last; b += 4)
        for (Size k = 0; k < count; k++) sums[k] += four(h + b) * four(c + k * length + b - a);
    for (Size k = 0; k < count; k++) out[a + k] += (sums[k][0] + sums[k][1]) + (sums[k][2] + sums[k][3]);
}

/* The covariance of a DOF's value with all weights, its row of H C; h is zero outside [first, last), the DOF's weights. */
INLINE void project(Size D, Size columns, const double *upper, const double *h, Size first, Size last,
                    double *restrict out) {
    Size a = 0;
    memset(out, 0, columns * sizeof(double));
    for (; a + 4 <= D && a < last; a += 4)
        project_lines(columns, 4, a, upper + line_at(columns, a), h, first, last, out);
    if (a < D && a < last) project_lines(columns, D - a, a, upper + line_at(columns, a), h, first, last, out);
}

/* Subtract V^T V from `count` lines from a on, for one row of V (step = 0) or for three. */
INLINE void subtract_lines(Size columns, Size count, Size a, double *restrict c, const double *restrict v, Size step) {
    Size length = columns - a;
    for (Size k = 0; k < count; k++, c += length) {
        double x = v[a + k], y = v[step + a + k], z = v[2 * step + a + k];
        for (Size b = 0; b < length; b += 4) {
            Four left = four(c + b) - x * four(v + a + b);
            if (step) left -= y * four(v + step + a + b) + z * four(v + 2 * step + a + b);
            *(Four *)(c + b) = left;
        }
    }
}

/* The covariance of the values of two DOFs with the same row of basis functions. */
INLINE double between(Size columns, Size N, const double *upper, const double *row, Size one, Size other) {
    Size i = one < other ? one : other, j = one < other ? other : one;
    double sum = 0.0;
    for (Size k = 0; k < N; k++) {
        const double *c = line(upper, columns, i * N + k) + j * N;
        sum += row[k] * (i < j ? dot(N, row, c) : row[k] * c[k] + 2.0 * dot(N - k - 1, row + k + 1, c + k + 1));
    }
    return sum;
}

/* rows <- L^-1 rows for S = L L^T (m, m), whose upper triangle becomes L^T. Returns 0 if S is not positive definite. */
INLINE int whiten(Size m, Size width, double *restrict S, double *restrict rows) {
    for (Size i = 0; i < m; i++) {
        if (!(S[i * m + i] > 0.0 && S[i * m + i] < INFINITY)) return 0;
        double scale = 1.0 / sqrt(S[i * m + i]);
        for (Size j = i; j < m; j++) S[i * m + j] *= scale;
        for (Size j = 0; j < width; j++) rows[i * width + j] *= scale;
        for (Size k = i + 1; k < m; k++) {
            double factor = S[i * m + k];
            for (Size j = k; j < m; j++) S[k * m + j] -= factor * S[i * m + j];
            for (Size j = 0; j < width; j++) rows[k * width + j] -= factor * rows[i * width + j];
        }
    }
    return 1;
}

INLINE double log_density(const Work *w, double squares, const double *L) {
    double log_scale = 0.0;
    for (Size i = 0; i < w->m; i++) log_scale += log(L[i * w->m + i]);
    if (isinf(w->freedom)) return w->constant - 0.5 * squares - log_scale;
    return w->constant - log_scale - 0.5 * (w->freedom + w->m) * log1p(squares / w->freedom);
}

/* Update the phase deviation of Gaussian h, and add the covariance that the uncertain phase induces to the noise. */
INLINE int weigh(const Work *w, Size h, const double *mean, double *deviation, double *noise, double *row, double *S,
                 double *apart, double *own, double *moved) {
    Size m = w->m, N = w->N, E = w->E;
    const double *rows = w->rows + h * E * N, *y = w->values + h * w->values_step;
    double *likelihood = w->likelihood + h * E, best = -INFINITY, total = 0.0, sum = 0.0;
    memcpy(moved, deviation, E * sizeof(double));
    if (w->transition) {
        memset(moved, 0, E * sizeof(double));
        for (Size e = 0; e < E; e++)
            for (Size f = 0; f < E; f++) moved[f] += deviation[e] * w->transition[(h * E + e) * E + f];
    }
    memset(row, 0, N * sizeof(double));
    for (Size e = 0; e < E; e++)
        for (Size k = 0; k < N; k++) row[k] += moved[e] * rows[e * N + k];
    for (Size i = 0; i < m; i++) {
        for (Size j = i; j < m; j++)
            S[i * m + j] = noise[i * m + j] + between(w->columns, N, mean + w->D, row, w->dofs[i], w->dofs[j]);
        for (Size e = 0; e < E; e++)
            own[i * E + e] = apart[i * E + e] = y[i] - dot(N, rows + e * N, mean + w->dofs[i] * N);
    }
    if (!whiten(m, E, S, own)) return 0;
    for (Size e = 0; e < E; e++) {
        double squares = 0.0;
        for (Size i = 0; i < m; i++) squares += own[i * E + e] * own[i * E + e];
        own[e] = log_density(w, squares, S);
        if (own[e] > best) best = own[e];
    }
    for (Size e = 0; e < E; e++) {
        total += moved[e] * exp(own[e] - best);
        likelihood[e] = exp(w->exponent * (own[e] - best));
        sum += deviation[e] = moved[e] * likelihood[e];
    }
    w->density[h] = log(total) + best;
    memset(row, 0, N * sizeof(double));
    for (Size e = 0; e < E; e++) {
        deviation[e] /= sum;
        for (Size k = 0; k < N; k++) row[k] += deviation[e] * rows[e * N + k];
    }
    for (Size i = 0; i < m; i++) {
        double expected = dot(E, deviation, apart + i * E);
        for (Size e = 0; e < E; e++) apart[i * E + e] -= expected;
    }
    for (Size i = 0; i < m; i++)
        for (Size j = 0; j < m; j++)
            for (Size e = 0; e < E; e++) noise[i * m + j] += deviation[e] * apart[i * E + e] * apart[j * E + e];
    return 1;
}

/* Returns the first Gaussian whose innovation covariance is not positive definite, or -1. */
INLINE Size condition_all(const Work *w) {
    const Size m = w->m, N = w->N, E = w->E, D = w->D, columns = w->columns, step = columns + 1;
    double *V = w->scratch, *S = V + m * step, *noise = S + m * m, *h_row = noise + m * m, *apart = h_row + columns,
           *own = apart + m * E, *moved = own + m * E, *row = moved + E;
    for (Size h = 0; h < w->n; h++) {
        Size at = w->index ? w->index[h] : h, next = h + 1 < w->n ? (w->index ? w->index[h + 1] : h + 1) : at;
        double *mean = w->state + at * w->width, *upper = mean + D;
        const double *y = w->values + h * w->values_step, *ahead = w->state + next * w->width;
        memcpy(noise, w->noise + h * w->noise_step, m * m * sizeof(double));
        memcpy(row, w->rows + h * N, N * sizeof(double));
        if (E > 1 && !weigh(w, h, mean, w->deviation + at * E, noise, row, S, apart, own, moved)) return h;
        for (Size i = 0; i < m; i++) {
            Size first = w->dofs[i] * N;
            memset(h_row, 0, columns * sizeof(double));
            memcpy(h_row + first, row, N * sizeof(double));
            project(D, columns, upper, h_row, first, first + N, V + i * step);
            V[i * step + columns] = y[i] - dot(N, row, mean + first);
        }
        for (Size i = 0; i < m; i++)
            for (Size j = i; j < m; j++) S[i * m + j] = noise[i * m + j] + dot(N, row, V + i * step + w->dofs[j] * N);
        if (!whiten(m, step, S, V)) return h;
        if (E == 1) {
            double squares = 0.0;
            for (Size i = 0; i < m; i++) squares += V[i * step + columns] * V[i * step + columns];
            w->density[h] = log_density(w, squares, S), w->likelihood[h] = 1.0;
        }
        for (Size i = 0; i < m; i++)
            for (Size j = 0; j < D; j++) mean[j] += V[i * step + columns] * V[i * step + j];
        for (Size a = 0; a < D; a += 4) {
            double *c = upper + line_at(columns, a);
            Size count = D - a < 4 ? D - a : 4, i = 0;
            for (Size b = 0; b < count * (columns - a); b += 8) FETCH(ahead + (c - mean) + b);
            for (; i + 3 <= m; i += 3) subtract_lines(columns, count, a, c, V + i * step, step);
            for (; i < m; i++) subtract_lines(columns, count, a, c, V + i * step, 0);
        }
    }
    return -1;
}

static Size condition_anywhere(const Work *w) { return condition_all(w); }
#ifdef __x86_64__
__attribute__((target("avx2,fma"))) static Size condition_avx2(const Work *w) { return condition_all(w); }
#endif

/* Returns the first Gaussian with a value or row that is not finite or noise that is not positive definite, or -1. */
static Size refused(const Work *w) {
    Size n_values = w->values_step ? w->n * w->m : w->m, n_noises = w->noise_step ? w->n : 1;
    for (Size k = 0; k < n_values; k++)
        if (!isfinite(w->values[k])) return k / w->m;
    for (Size k = 0; k < w->n * w->E * w->N; k++)
        if (!isfinite(w->rows[k])) return k / (w->E * w->N);
    for (Size h = 0; h < n_noises; h++) {
        memcpy(w->scratch, w->noise + h * w->m * w->m, w->m * w->m * sizeof(double));
        if (!whiten(w->m, 0, w->scratch, w->scratch + w->m * w->m)) return h;
    }
    return -1;
}

/* condition(state, index, deviation, dofs, rows, values, noise, transition, density, likelihood, P, N, exponent, freedom) */
static PyObject *condition(PyObject *module, PyObject *arguments) {
    Py_buffer b[10];
    Work w;
    Size found = -2;
    memset(b, 0, sizeof b);
    if (!PyArg_ParseTuple(arguments, "w*z*w*y*y*y*y*z*w*w*nndd:condition", b, b + 1, b + 2, b + 4, b + 5, b + 6, b + 7,
                          b + 3, b + 8, b + 9, &w.P, &w.N, &w.exponent, &w.freedom))
        return NULL;
    w.state = b[0].buf, w.index = b[1].buf, w.deviation = b[2].buf, w.transition = b[3].buf, w.dofs = b[4].buf;
    w.rows = b[5].buf, w.values = b[6].buf, w.noise = b[7].buf, w.density = b[8].buf, w.likelihood = b[9].buf;
    w.D = w.P * w.N, w.columns = (w.D + 3) / 4 * 4, w.width = w.D + line_at(w.columns, w.D), w.n = b[8].len / 8, w.m = b[4].len / 8;
    w.n_rows = w.width > 0 ? b[0].len / 8 / w.width : 0, w.E = w.n_rows ? b[2].len / 8 / w.n_rows : 1;
    w.values_step = b[6].len / 8 == w.m ? 0 : w.m, w.noise_step = b[7].len / 8 == w.m * w.m ? 0 : w.m * w.m;
    int fits = w.P > 0 && w.N > 0 && w.m > 0 && w.E > 0 && b[0].len == 8 * w.n_rows * w.width &&
               b[1].len == (w.index ? 8 * w.n : 0) && (w.index || w.n == w.n_rows) && b[2].len == 8 * w.n_rows * w.E &&
               b[3].len == (w.transition ? 8 * w.n * w.E * w.E : 0) && b[5].len == 8 * w.n * w.E * w.N &&
               b[6].len == 8 * w.m * (w.values_step ? w.n : 1) && b[9].len == 8 * w.n * w.E &&
               b[7].len == 8 * w.m * w.m * (w.noise_step ? w.n : 1);
    for (Size i = 0; fits && i < w.m; i++) fits = w.dofs[i] >= 0 && w.dofs[i] < w.P;
    for (Size h = 0; fits && w.index && h < w.n; h++) fits = w.index[h] >= 0 && w.index[h] < w.n_rows;
    if (fits) {
        w.scratch = PyMem_Malloc(sizeof(double) * (w.m * (w.columns + 1 + 2 * w.m + 2 * w.E) + w.columns + w.N + w.E));
        if (w.scratch) {
            w.constant = -0.5 * (double)w.m * log(2.0 * 3.14159265358979323846);
            if (!isinf(w.freedom))
                w.constant = lgamma(0.5 * (w.freedom + w.m)) - lgamma(0.5 * w.freedom) -
                             0.5 * w.m * log(w.freedom * 3.14159265358979323846);
            found = refused(&w);
#ifdef __x86_64__
            if (found < 0 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) found = condition_avx2(&w);
            else
#endif
            if (found < 0) found = condition_anywhere(&w);
            PyMem_Free(w.scratch);
        } else
            PyErr_NoMemory();
    } else
        PyErr_SetString(PyExc_ValueError, "the arrays do not fit each other");
    for (int k = 0; k < 10; k++) PyBuffer_Release(b + k);
    return found == -2 ? NULL : PyLong_FromSsize_t(found);
}

static PyMethodDef methods[] = {{"condition", condition, METH_VARARGS, NULL}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_kernel", NULL, 0, methods, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit__kernel(void) { return PyModule_Create(&module); }
