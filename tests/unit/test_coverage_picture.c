/* SPDX-License-Identifier: MIT */
/* The coloured mesh of a coverage: each vertex has the numbers of its own cell. */
#include "core/bytes.h"
#include "core/colour.h"
#include "core/studio/coverage/inside.h"
#include "tests/unit/coverage_rig.h"
#include "tests/unit/scene_files.h"

enum { VERTEX = 24 + 3 + 2 + 3 * 4 + 8, FACE = 1 + 12 };

/* The file, read back: its vertices and faces are [n] records. */
struct file {
    uint8_t *bytes;
    const uint8_t *vertex, *face;
    size_t n_vertices, n_faces;
};

static struct file write_and_read(const struct cover *c, enum coverage_colour colour)
{
    struct file f = {.bytes = NULL};
    struct sh_err err;
    char name[160];
    snprintf(name, sizeof name, "%s", path_in("cover.ply"));
    if (coverage_write_mesh(c->coverage, name, colour, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    FILE *in = fopen(name, "rb");
    assert_non_null(in);
    f.bytes = calloc(1, 1 << 22);
    assert_non_null(f.bytes);
    const size_t n = fread(f.bytes, 1, (1 << 22) - 1, in);
    fclose(in);
    unlink(name);
    const char *head = (const char *)f.bytes, *end = strstr(head, "end_header\n");
    static const char scalars[] = "property ushort stations\nproperty float density\nproperty float incidence_deg\n"
                                  "property float range_m\nproperty double cell\n";
    assert_non_null(end);
    assert_non_null(strstr(head, scalars));
    assert_non_null(strstr(head, "comment -1: the cell is not seen\n"));
    assert_int_equal(sscanf(strstr(head, "element vertex"), "element vertex %zu", &f.n_vertices), 1);
    assert_int_equal(sscanf(strstr(head, "element face"), "element face %zu", &f.n_faces), 1);
    f.vertex = (const uint8_t *)end + 11;
    f.face = f.vertex + f.n_vertices * VERTEX;
    assert_int_equal(f.bytes + n - f.face, f.n_faces * FACE);
    return f;
}

static void place_of(const struct file *f, uint32_t i, double p[3])
{
    for (int k = 0; k < 3; k++)
        p[k] = le_get_double(f->vertex + i * VERTEX + 8 * k);
}

static uint32_t cell_of(const uint8_t *vertex)
{
    const double cell = le_get_double(vertex + 41);
    assert_true(cell >= 0.0 && cell == floor(cell));
    return (uint32_t)cell;
}

static void check_figures(const struct cover *c, const struct file *f, size_t seen[3])
{
    for (size_t i = 0; i < f->n_vertices; i++) {
        const uint8_t *v = f->vertex + i * VERTEX;
        struct coverage_cell cell;
        coverage_get(c->coverage, cell_of(v), &cell);
        assert_int_equal(le_get16(v + 27), cell.stations);
        assert_true(le_get_float(v + 29) == (float)(cell.pulses / cell.area_m2));
        const double degrees = cell.incidence_rad * 180.0 / M_PI;
        if (cell.stations == 0)
            assert_true(le_get_float(v + 33) == -1.0f && le_get_float(v + 37) == -1.0f);
        else
            assert_true(fabs((double)le_get_float(v + 33) - degrees) < 1e-5 &&
                        le_get_float(v + 37) == (float)cell.range_m);
        seen[cell.stations]++;
    }
}

/* The triangles of a cell add up to its area, and no triangle belongs to two cells. */
static void check_faces(const struct cover *c, const struct file *f)
{
    double *area_m2 = calloc(coverage_cells(c->coverage), sizeof *area_m2);
    assert_non_null(area_m2);
    for (size_t i = 0; i < f->n_faces; i++) {
        const uint8_t *face = f->face + i * FACE;
        double p[3][3], a[3], b[3], n[3];
        uint32_t cell[3];
        assert_int_equal(face[0], 3);
        for (int k = 0; k < 3; k++) {
            const uint32_t v = le_get32(face + 1 + 4 * k);
            assert_true(v < f->n_vertices);
            place_of(f, v, p[k]);
            cell[k] = cell_of(f->vertex + v * VERTEX);
        }
        assert_true(cell[0] == cell[1] && cell[1] == cell[2]);
        vec3_sub(p[1], p[0], a);
        vec3_sub(p[2], p[0], b);
        vec3_cross(a, b, n);
        area_m2[cell[0]] += 0.5 * vec3_length(n);
    }
    for (uint32_t i = 0; i < coverage_cells(c->coverage); i++) {
        struct coverage_cell cell;
        coverage_get(c->coverage, i, &cell);
        assert_true(fabs(area_m2[i] - cell.area_m2) < 1e-9);
    }
    free(area_m2);
}

/* Seen by none is red, by one yellow, by several green. The other colours are on the ramp, or grey where nothing is
 * seen. Densities are in decades from the 5 % to the 95 % of the area. */
static void check_colour(const struct coverage_cell *cell, const struct coverage_sums *sums,
                         enum coverage_colour colour, const uint8_t rgb[3])
{
    uint8_t want[3];
    if (colour == COVERAGE_SEEN) {
        const int is_red = rgb[0] > 2 * rgb[1] && rgb[0] > 2 * rgb[2],
                  is_green = rgb[1] > 2 * rgb[0] && rgb[1] > rgb[2];
        const int is_yellow = rgb[0] > 2 * rgb[2] && rgb[1] > 2 * rgb[2];
        assert_true(cell->stations == 0 ? is_red : cell->stations == 1 ? is_yellow : is_green);
        return;
    }
    const double low = log10(sums->density_1_m2.p05), high = log10(sums->density_1_m2.p95);
    const double part = colour == COVERAGE_COUNT     ? cell->stations / 2.0
                        : colour == COVERAGE_DENSITY ? (log10(cell->pulses / cell->area_m2) - low) / (high - low)
                                                     : cell->incidence_rad / M_PI_2;
    colour_ramp(part, want);
    if (colour != COVERAGE_COUNT && cell->stations == 0)
        assert_true(rgb[0] == rgb[1] && rgb[1] == rgb[2]);
    else
        assert_memory_equal(rgb, want, 3);
}

static void numbers_and_colours_of_cells(void **state)
{
    (void)state;
    static const double station_m[2][3] = {{5.0, 1.0, 1.2}, {1.0, 1.0, 1.2}};
    static const struct cover_sweep sweep = {2.0, -60.0, 60.0, 0.0, 360.0, 1000.0};
    struct cover *c = cover_open(cover_l_room(), 0.5, 1);
    struct coverage_pulses pulses;
    struct coverage_sums sums;
    struct sh_err err;
    for (int i = 0; i < 2; i++)
        cover_look(c, station_m[i], &sweep, &pulses);
    assert_int_equal(coverage_sum(c->coverage, &sums, &err), SH_OK);
    for (enum coverage_colour colour = COVERAGE_SEEN; colour <= COVERAGE_INCIDENCE; colour++) {
        const struct file f = write_and_read(c, colour);
        size_t seen[3] = {0, 0, 0};
        check_figures(c, &f, seen);
        assert_true(seen[0] > 10 && seen[1] > 10 && seen[2] > 10);
        if (colour == COVERAGE_SEEN) check_faces(c, &f);
        for (size_t i = 0; i < f.n_vertices; i++) {
            struct coverage_cell cell;
            coverage_get(c->coverage, cell_of(f.vertex + i * VERTEX), &cell);
            check_colour(&cell, &sums, colour, f.vertex + i * VERTEX + 24);
        }
        free(f.bytes);
    }
    cover_close(c);
}

/* Without a station no cell is seen: counts have the ramp's lowest colour, and densities and angles are grey. */
static void nothing_is_seen(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 1.0, 1);
    for (enum coverage_colour colour = COVERAGE_SEEN; colour <= COVERAGE_INCIDENCE; colour++) {
        const struct file f = write_and_read(c, colour);
        size_t seen[3] = {0, 0, 0};
        uint8_t least[3];
        check_figures(c, &f, seen);
        assert_int_equal(seen[0], f.n_vertices);
        colour_ramp(0.0, least);
        for (size_t i = 0; i < f.n_vertices; i++) {
            const uint8_t *rgb = f.vertex + i * VERTEX + 24;
            if (colour == COVERAGE_COUNT) assert_memory_equal(rgb, least, 3);
            if (colour >= COVERAGE_DENSITY) assert_true(rgb[0] == rgb[1] && rgb[1] == rgb[2]);
        }
        free(f.bytes);
    }
    cover_close(c);
}

/* The corners and triangles of a mesh are in memory before they are written, as in the file but without each face's
 * count of corners. They must fit into the allowed memory. */
static void a_mesh_is_within_the_memory(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 1.0, 1);
    const struct file f = write_and_read(c, COVERAGE_SEEN);
    const double mib = (double)(f.n_vertices * VERTEX + f.n_faces * (FACE - 1)) / 1048576.0;
    struct sh_err err;
    char corners[80];
    free(f.bytes);
    snprintf(corners, sizeof corners, "a mesh of cells of 1 m has %zu corners", f.n_vertices);
    c->coverage->spec.memory_mib = mib * 1.000001;
    free(write_and_read(c, COVERAGE_SEEN).bytes);
    c->coverage->spec.memory_mib = mib * 0.999999;
    assert_int_equal(coverage_write_mesh(c->coverage, path_in("none.ply"), COVERAGE_SEEN, NULL, &err), SH_EINPUT);
    /* cells of 1.5 m are a little fewer than half as many */
    if (strstr(err.text, corners) == NULL || strstr(err.text, "use a cell of at least 1.5 m") == NULL)
        fail_msg("%s", err.text);
    cover_close(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_and_colours_of_cells),
        cmocka_unit_test(nothing_is_seen),
        cmocka_unit_test(a_mesh_is_within_the_memory),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
