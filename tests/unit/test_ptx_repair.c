/* SPDX-License-Identifier: MIT */
/* PTX files whose recorder was killed, or whose disk was full: the result of a repair, for them and the grid beside
 * them, wherever these end. */
#include "tests/common/thorough.h"
#include "tests/unit/killed_rig.h"

enum { HEAD_LEN = 120, CELL_LEN = 40, MAX_SHOTS = 512, MAX_STATES = 64 };

/* A shot's coordinates give its place: x and y in the head's frame are (line + 1) and (row + 1) mm. */
struct shot {
    int scan, line, row, has_echo;
};
static struct shot shot[MAX_SHOTS];
static int n_shots, coloured;

/* The disk's contents after each frame. */
static struct state {
    uint8_t *text, *grid;
    size_t text_len, grid_len;
} state_at[MAX_STATES];
static int n_states;
static uint8_t *whole;
static size_t whole_len;

static void keep_state(const char *part)
{
    char grid[160];
    struct state *s = &state_at[n_states++];
    assert_true(n_states <= MAX_STATES);
    snprintf(grid, sizeof grid, "%.*s.grid", (int)strlen(part) - 5, part);
    s->text = rig_read(part, &s->text_len);
    s->grid = rig_read(grid, &s->grid_len);
}

static void forget(void)
{
    for (int i = 0; i < n_states; i++) {
        free(state_at[i].text);
        free(state_at[i].grid);
    }
    free(whole);
    whole = NULL;
    n_states = n_shots = 0;
}

/* Lines have unequal lengths, and begin at different rows. Every third shot has no echo, but all of the second scan
 * have one. */
static void put_line(int scan, uint32_t line, uint32_t row, int n)
{
    static struct rig_point p[32];
    for (int i = 0; i < n; i++) {
        const int has_echo = scan == 1 || (i + (int)line) % 3 != 0;
        const int at = (int)row + i;
        p[i] = has_echo ? (struct rig_point){at + 1, -(int)line - 1, 5000, INT16_MIN, (uint16_t)at, 1, 1}
                        : (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0};
        assert_true(n_shots < MAX_SHOTS);
        shot[n_shots++] = (struct shot){scan, (int)line, at, has_echo};
    }
    rig_points(line, 100 * line, 100 * line + row, p, (uint32_t)n);
}

static void record_scans(void)
{
    static const int n_lines[] = {5, 1, 7};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const char *path = rig_path("a.ptx");
    forget();
    rig_begin();
    for (int scan = 0; scan < 3; scan++) {
        a.station = (uint32_t)scan + 1;
        a.anchor[0] += 7;
        rig_descriptor(1, (uint32_t)scan + 1);
        rig_anchor(&a);
        for (int line = 0; line < n_lines[scan]; line++)
            put_line(scan, (uint32_t)(line + line / 3), line % 2 ? 4 : 6, 9 + line % 4);
    }
    const struct colour_choice colour = {.given = coloured, .scale.mode = COLOUR_LABEL};
    killed_rig_record(path, (struct recorder_options){.colour = colour}, keep_state);
    whole = rig_read(path, &whole_len);
    unlink(path);
}

/* ---- a file's contents */

static const char *next_line(const char *at)
{
    at = strchr(at, '\n');
    assert_non_null(at);
    return at + 1;
}

/* Each grid has the shape of its header, and its points are where their coordinates say. The points are the first ones
 * of the stream. Returns how many points there are. */
static uint64_t check_text(const uint8_t *text, uint64_t *n_grids)
{
    const char *at = (const char *)text;
    uint64_t n = 0;
    int s = 0;
    *n_grids = 0;
    for (; *at != 0; ++*n_grids) {
        unsigned long columns, rows, first = 0;
        long column0 = 0, row0 = 0;
        assert_int_equal(sscanf(at, "%lu %lu", &columns, &rows), 2);
        for (int i = 0; i < 10; i++)
            at = next_line(at);
        for (unsigned long i = 0; i < columns * rows; i++, at = next_line(at)) {
            double x, y, z, shine;
            unsigned rgb[3];
            char line_text[128];
            snprintf(line_text, sizeof line_text, "%.*s", (int)strcspn(at, "\n"), at);
            assert_int_equal(
                sscanf(line_text, "%lf %lf %lf %lf %u %u %u", &x, &y, &z, &shine, &rgb[0], &rgb[1], &rgb[2]),
                coloured ? 7 : 4);
            if (x == 0) continue;
            const long line = lrint(1000 * x) - 1, row = lrint(1000 * y) - 1;
            while (!shot[s].has_echo)
                s++;
            assert_true(s < n_shots && line == shot[s].line && row == shot[s].row);
            assert_int_equal(shot[s++].scan, *n_grids);
            if (first++ == 0) {
                column0 = line - (long)(i / rows);
                row0 = row - (long)(i % rows);
            }
            assert_int_equal(column0 + (long)(i / rows), line);
            assert_int_equal(row0 + (long)(i % rows), row);
            n++;
        }
    }
    return n;
}

/* Returns how many echoes are in the first n cells of a grid's file. There is a cell for each shot that has an echo, or
 * that lies beyond all before it. */
static int echoes_in(int scan, size_t n)
{
    int low = 0, high = 0, last = -1, echoes = 0, first = 1;
    for (int i = 0; i < n_shots && n > 0; i++) {
        const struct shot *s = &shot[i];
        if (s->scan != scan) continue;
        const int beyond = first || s->line > last || s->row < low || s->row > high;
        low = first || s->row < low ? s->row : low;
        high = first || s->row > high ? s->row : high;
        last = s->line;
        first = 0;
        if (!s->has_echo && !beyond) continue;
        echoes += s->has_echo;
        n--;
    }
    return echoes;
}

static int echoes_before(int scan)
{
    int n = 0;
    for (int i = 0; i < n_shots; i++)
        n += shot[i].scan < scan && shot[i].has_echo;
    return n;
}

/* ---- repairs */

static const char *const part = "cut.ptx.part";

static void write_state(const void *text, size_t text_len, const void *grid, size_t grid_len)
{
    killed_rig_write(rig_path(part), text, text_len);
    if (grid != NULL) killed_rig_write(rig_path("cut.ptx.grid"), grid, grid_len);
}

static void remove_state(void)
{
    unlink(rig_path(part));
    unlink(rig_path("cut.ptx.grid"));
}

/* The file after a repair that succeeds: it is whole, with `want` points, and the grid is gone. */
static uint8_t *repair_well(uint64_t want, size_t *len)
{
    struct repair r;
    struct sh_err err;
    uint64_t n_grids;
    if (killed_rig_repair(rig_path(part), &r, &err) != 0) fail_msg("%s", err.text);
    uint8_t *text = rig_read(rig_path(part), len), *again;
    assert_int_equal(check_text(text, &n_grids), want);
    assert_int_equal(r.n_kept, want);
    assert_int_equal(r.n_scans, n_grids);
    assert_string_equal(r.unit, "points");
    assert_int_equal(access(rig_path("cut.ptx.grid"), F_OK), -1);
    assert_int_equal(killed_rig_repair(rig_path(part), &r, &err), 0);
    assert_int_equal(r.was_whole, 1);
    assert_int_equal(r.n_kept, want);
    size_t again_len;
    again = rig_read(rig_path(part), &again_len);
    assert_int_equal(again_len, *len);
    assert_memory_equal(again, text, again_len);
    free(again);
    return text;
}

/* Returns how many grids are there as text, up to the place of the incomplete one. */
static int grids_in(const uint8_t *text)
{
    const char *at = (const char *)text;
    int n = 0;
    for (; *at != 0 && strcmp(at, "0\n0\n") != 0; n++) {
        unsigned long columns, rows;
        assert_int_equal(sscanf(at, "%lu %lu", &columns, &rows), 2);
        for (unsigned long i = 0; i < 10 + columns * rows; i++)
            at = next_line(at);
    }
    return n;
}

/* Whenever the recorder is killed, the saved points are there. The file of the last grid may end anywhere. */
static void test_killed(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    size_t len;
    for (coloured = 0; coloured < 2; coloured++) {
        record_scans();
        for (int i = 0; i < n_states; i++) {
            const struct state *s = &state_at[i];
            const int scan = grids_in(s->text);
            const size_t from = i == n_states - 1 ? HEAD_LEN + CELL_LEN : s->grid_len;
            for (size_t cut = from; cut <= s->grid_len; cut += SANITIZED ? 157 : 17) {
                write_state(s->text, s->text_len, s->grid, cut);
                if (s->grid_len == 0) { /* no scan has begun */
                    assert_int_equal(killed_rig_repair(rig_path(part), &r, &err), SH_EFORMAT);
                    continue;
                }
                const int want = echoes_before(scan) + echoes_in(scan, (cut - HEAD_LEN) / CELL_LEN);
                free(repair_well((uint64_t)want, &len));
            }
        }
    }
    coloured = 0;
    remove_state();
}

/* All shots have come, and any part of the last grid's text is written. The whole file comes out to the byte. */
static void test_completing(void **state)
{
    (void)state;
    size_t len;
    record_scans();
    const struct state *s = &state_at[n_states - 1];
    for (size_t text = s->text_len - 4; text <= whole_len; text += 197) {
        write_state(whole, text, s->grid, s->grid_len);
        uint8_t *now = repair_well((uint64_t)echoes_before(3), &len);
        assert_int_equal(len, whole_len);
        assert_memory_equal(now, whole, len);
        free(now);
    }
    write_state(whole, whole_len, s->grid, 0); /* the text is complete, and the grid's file empty again */
    free(repair_well((uint64_t)echoes_before(3), &len));
    assert_int_equal(len, whole_len);
    remove_state();
}

/* Returns the points in the first n bytes of the whole text, in its whole lines. */
static uint64_t points_in(size_t n, int *any)
{
    const char *at = (const char *)whole, *end = at + n;
    uint64_t points = 0;
    *any = 0;
    while (at < end) {
        unsigned long columns = 0, rows = 0;
        sscanf(at, "%lu %lu", &columns, &rows);
        for (unsigned long i = 0; i < 10 + columns * rows; i++) {
            const char *stop = memchr(at, '\n', (size_t)(end - at));
            if (stop == NULL) return points;
            if (i >= 10) *any = 1;
            points += i >= 10 && strncmp(at, "0 0 0 0.5", 9) != 0;
            at = stop + 1;
        }
    }
    return points;
}

/* The text alone is cut anywhere, and loses none of its points. */
static void test_text_alone(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    for (coloured = 0; coloured < 2; coloured++) {
        record_scans();
        for (size_t cut = 0; cut <= whole_len; cut += SANITIZED ? 337 : 37) {
            int any;
            size_t len;
            const uint64_t want = points_in(cut, &any);
            write_state(whole, cut, NULL, 0);
            if (any)
                free(repair_well(want, &len));
            else
                assert_int_equal(killed_rig_repair(rig_path(part), &r, &err), SH_EFORMAT);
        }
    }
    coloured = 0;
    remove_state();
}

static void check_refused(const char *text, const void *grid, size_t grid_len, const char *why)
{
    struct repair r;
    struct sh_err err;
    size_t len;
    write_state(text, strlen(text), grid, grid_len);
    assert_int_equal(killed_rig_repair(rig_path(part), &r, &err), SH_EFORMAT);
    if (strstr(err.text, why) == NULL) fail_msg("%s", err.text);
    assert_null(strchr(err.text, '\n'));
    uint8_t *now = rig_read(rig_path(part), &len);
    assert_string_equal((char *)now, text);
    free(now);
}

#define POSE "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"

/* Other files, damage and absurd numbers give a line that says so, and nothing is changed. */
static void test_refused(void **state)
{
    (void)state;
    check_refused("", NULL, 0, "is not a PTX grid");
    check_refused("ply\nformat ascii 1.0\n", NULL, 0, "is not a PTX grid");
    check_refused("2\n1\n" POSE "1 2 3 1\nhello\n4 5 6 1\n", NULL, 0, "damaged");
    check_refused("18446744073709551615\n1\n" POSE "1 2 3 1\n", NULL, 0, ".part: is ");
    check_refused("1\n0\n" POSE "1 2 3 1\n", NULL, 0, ".part: is ");
    check_refused("-1\n2\n" POSE "1 2 3 1\n", NULL, 0, ".part: is ");
    check_refused("1x\n1\n" POSE "1 2 3 1\n", NULL, 0, ".part: is ");
    record_scans();
    const struct state *s = &state_at[n_states - 1];
    uint8_t *grid = malloc(s->grid_len);
    memcpy(grid, s->grid, s->grid_len);
    grid[HEAD_LEN + 3 * CELL_LEN + 5] ^= 1;
    char why[80]; /* the last good cells are those before the fourth */
    snprintf(why, sizeof why, ".grid: is damaged at byte %d, before its end", HEAD_LEN + 3 * CELL_LEN);
    check_refused((char *)s->text, grid, s->grid_len, why);
    check_refused("1\n1\n" POSE "1 2 3 1\n", s->grid, s->grid_len, "no grid ends there"); /* of another recording */
    free(grid);
    remove_state();
}

/* A header that is cut goes, with all its lines: none, one or more of them are whole. */
static void test_headers_that_are_cut(void **state)
{
    (void)state;
    static const char grid[] = "1\n1\n" POSE "0 0 0 0.5\n", next[] = "12\n34\n" POSE;
    const size_t whole_grid = sizeof grid - 1;
    for (size_t more = 0; more < sizeof next; more++) {
        char text[2 * sizeof grid + sizeof next];
        size_t len;
        snprintf(text, sizeof text, "%s%.*s", grid, (int)more, next);
        write_state(text, strlen(text), NULL, 0);
        uint8_t *now = repair_well(0, &len);
        assert_int_equal(len, whole_grid);
        assert_memory_equal(now, grid, whole_grid);
        free(now);
    }
    remove_state();
}

/* Cells of a killed recorder never go back. A cell at the end that does is no cell of this grid, and is cut. */
static void test_cell_that_goes_back(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    record_scans();
    const struct state *s = &state_at[n_states - 1];
    const int scan = grids_in(s->text);
    uint8_t *grid = malloc(s->grid_len);
    memcpy(grid, s->grid, s->grid_len);
    memcpy(grid + s->grid_len - CELL_LEN, grid + HEAD_LEN, CELL_LEN);
    write_state(s->text, s->text_len, grid, s->grid_len);
    free(grid);
    if (killed_rig_repair(rig_path(part), &r, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(r.cut_bytes, CELL_LEN);
    assert_int_equal(r.n_kept, echoes_before(scan) + echoes_in(scan, (s->grid_len - HEAD_LEN) / CELL_LEN - 1));
    remove_state();
}

/* Where there is no room for the grid's text, both files stay, and a repair with room takes them. */
static void test_full_disk(void **state)
{
    (void)state;
    struct repair r;
    struct sh_err err;
    struct rlimit old;
    char want[600], in[160], beside[160];
    record_scans();
    const struct state *s = &state_at[n_states - 1];
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    write_state(s->text, s->text_len, s->grid, s->grid_len);
    snprintf(in, sizeof in, "%s", rig_path(part));
    snprintf(beside, sizeof beside, "%.*s.grid", (int)strlen(in) - 5, in);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){s->text_len, old.rlim_max}), 0);
    const int rc = killed_rig_repair(in, &r, &err);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, was);
    assert_int_equal(rc, SH_EIO);
    snprintf(
        want, sizeof want,
        "%s: cannot be written together with the grid in %s: the grid's text needs as much room again on the disk; "
        "nothing is lost: free some room and repeat the command",
        in, beside);
    assert_string_equal(err.text, want);
    size_t len;
    uint8_t *grid = rig_read(beside, &len), *text = rig_read(in, NULL);
    assert_int_equal(len, s->grid_len);
    assert_memory_equal(grid, s->grid, len);
    assert_memory_equal(text, s->text, rig_uint(grid + 8, 8)); /* up to the grid's own text */
    free(grid);
    free(text);
    if (killed_rig_repair(in, &r, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(access(beside, F_OK), -1);
    remove_state();
}

/* Lines of other programs may end with blanks, or with a carriage return. */
static void test_line_ends(void **state)
{
    static const char text[] = "1\r\n2  \r\n0 0 0\r\n1 0 0\r\n0 1 0\r\n0 0 1\r\n1 0 0 0\r\n0 1 0 0\r\n0 0 1 0\r\n"
                               "0 0 0 1\r\n1 2 3 1 \n0 0 0 0.5\r\n";
    (void)state;
    struct repair r;
    struct sh_err err;
    write_state(text, sizeof text - 1, NULL, 0);
    if (killed_rig_repair(rig_path(part), &r, &err) != 0) fail_msg("%s", err.text);
    assert_true(r.was_whole && r.n_kept == 1 && r.n_scans == 1);
    remove_state();
}

static int tear_down(void **state)
{
    forget();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_killed),
        cmocka_unit_test(test_completing),
        cmocka_unit_test(test_text_alone),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_headers_that_are_cut),
        cmocka_unit_test(test_line_ends),
        cmocka_unit_test(test_cell_that_goes_back),
        cmocka_unit_test(test_full_disk),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
