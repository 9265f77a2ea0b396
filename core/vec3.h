/* Products of vectors of three doubles. */
#ifndef CORE_VEC3_H
#define CORE_VEC3_H

/* Vectors as arrays, one per axis; the arrays stay the caller's. */
struct vec3_in {
    const double *x, *y, *z;
};
struct vec3_out {
    double *x, *y, *z;
};

static inline double vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline void vec3_cross(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
