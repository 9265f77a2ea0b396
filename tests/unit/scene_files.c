/* SPDX-License-Identifier: MIT */
#include "tests/unit/scene_files.h"

#include "tests/common/free_fd.h"

char folder[64];
char path[128];
char warnings[4096];
int n_warnings;
static int fd_before;

int make_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/scanhead-scene-XXXXXX");
    fd_before = free_fd();
    return mkdtemp(folder) == NULL ? -1 : 0;
}

int remove_folder(void **state)
{
    (void)state;
    return rmdir(folder) != 0 ? -1 : free_fd_check(fd_before);
}

const char *path_in(const char *name)
{
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

const char *write_file(const char *name, const void *data, size_t len)
{
    FILE *f = fopen(path_in(name), "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, len, f), len);
    assert_int_equal(fclose(f), 0);
    return path;
}

const char *write_text(const char *name, const char *text)
{
    return write_file(name, text, strlen(text));
}

void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    n_warnings++;
    strncat(warnings, text, sizeof warnings - strlen(warnings) - 2);
    strcat(warnings, "\n");
}

int load_spec(const struct scene_mesh_spec *spec, double tolerance_m, struct scene **out, struct sh_err *err)
{
    const struct sh_report report = {.warn = keep_warning};
    n_warnings = 0;
    warnings[0] = '\0';
    err->text[0] = '\0';
    return scene_load(spec, 1, tolerance_m, &report, out, err);
}

struct scene *load(const char *file)
{
    struct scene *scene;
    struct sh_err err;
    const struct scene_mesh_spec spec = {.file = file, .scale = 1};
    int rc = load_spec(&spec, 1e-3, &scene, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return scene;
}

struct scene *load_text(const char *name, const char *text)
{
    struct scene *scene = load(write_text(name, text));
    unlink(path);
    return scene;
}

void refuse(const char *name, const void *data, size_t len, const char *expected)
{
    struct scene *scene;
    struct sh_err err;
    const struct scene_mesh_spec spec = {.file = write_file(name, data, len), .scale = 1};
    int rc = load_spec(&spec, 1e-3, &scene, &err);
    unlink(path);
    if (rc != SH_EINPUT || scene != NULL) fail_msg("%s, for '%s': returned %d", name, expected, rc);
    if (strstr(err.text, name) == NULL || strstr(err.text, expected) == NULL || strchr(err.text, '\n') != NULL)
        fail_msg("'%s' doesn't say '%s' of %s in one line", err.text, expected, name);
}

double triangle_area(const struct scene *s, uint32_t i)
{
    const double *a = s->vertex_m[s->triangle[i][0]], *b = s->vertex_m[s->triangle[i][1]],
                 *c = s->vertex_m[s->triangle[i][2]];
    double u[3], v[3];
    for (int k = 0; k < 3; k++) {
        u[k] = b[k] - a[k];
        v[k] = c[k] - a[k];
    }
    double n[3] = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
    return __builtin_sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) / 2;
}

double total_area(const struct scene *s)
{
    double area = 0;
    for (uint32_t i = 0; i < s->n_triangles; i++)
        area += triangle_area(s, i);
    return area;
}

double total_volume(const struct scene *s)
{
    double six = 0;
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        const double *a = s->vertex_m[s->triangle[i][0]], *b = s->vertex_m[s->triangle[i][1]],
                     *c = s->vertex_m[s->triangle[i][2]];
        six += a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
               a[2] * (b[0] * c[1] - b[1] * c[0]);
    }
    return six / 6;
}
