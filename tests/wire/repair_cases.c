/* SPDX-License-Identifier: MIT */
#include "tests/wire/repair_cases.h"

#include "core/bytes.h"

/* Returns the place after this text; 0: it is not there. */
static size_t behind(const struct bytes *b, const char *text)
{
    const uint8_t *at = memmem(b->data, b->len, text, strlen(text));
    return at != NULL ? (size_t)(at - b->data) + strlen(text) : 0;
}

/* From `begin` on, the repaired file must have exactly the first `len` bytes of the whole one. */
static void expect_begin(const struct bytes *whole, const struct bytes *repaired, size_t begin, size_t len)
{
    assert_int_equal(repaired->len, begin + len);
    assert_true(whole->len >= begin + len);
    assert_memory_equal(repaired->data + begin, whole->data + begin, len);
}

static size_t count_lines(const uint8_t *from, size_t len)
{
    size_t n = 0;
    for (size_t i = 0; i < len; i++)
        n += from[i] == '\n';
    return n;
}

/* Returns the place after the last newline. */
static size_t end_of_lines(const struct bytes *b, size_t begin)
{
    size_t end = b->len;
    while (end > begin && b->data[end - 1] != '\n')
        end--;
    return end;
}

/* ---- .ply */

static size_t ply_begin(const struct bytes *b)
{
    return behind(b, "\nend_header\n");
}

static uint64_t ply_count(const struct bytes *b)
{
    const size_t at = behind(b, "\nelement vertex ");
    assert_true(at > 0);
    return strtoull((const char *)b->data + at, NULL, 10);
}

static void ply_says_so(const struct bytes *repaired, uint64_t n)
{
    assert_int_equal(ply_count(repaired), n);
    const size_t at = behind(repaired, "\ncomment incomplete: its end is missing");
    assert_true(at > 0 && at < ply_begin(repaired));
}

static uint64_t check_ply(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    const size_t begin = ply_begin(whole), row = (whole->len - begin) / (size_t)ply_count(whole);
    assert_int_equal(ply_begin(left), begin);
    const size_t n = (left->len - begin) / row;
    expect_begin(whole, repaired, begin, n * row);
    ply_says_so(repaired, n);
    return n;
}

static uint64_t check_ply_text(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    const size_t begin = ply_begin(whole), end = end_of_lines(left, begin);
    assert_int_equal(ply_begin(left), begin);
    expect_begin(whole, repaired, begin, end - begin);
    const size_t n = count_lines(left->data + begin, end - begin);
    ply_says_so(repaired, n);
    return n;
}

static int is_no_ply(const struct bytes *left)
{
    return ply_begin(left) == 0;
}

/* ---- .las */

static double las_double(const struct bytes *b, size_t at)
{
    const uint64_t bits = le_get64(b->data + at);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static void check_las_bounds(const struct bytes *b, size_t begin, size_t row, size_t n)
{
    for (size_t axis = 0; axis < 3 && n > 0; axis++) {
        int32_t lo = INT32_MAX, hi = INT32_MIN;
        for (size_t i = 0; i < n; i++) {
            const int32_t v = (int32_t)le_get32(b->data + begin + i * row + 4 * axis);
            if (v < lo) lo = v;
            if (v > hi) hi = v;
        }
        const double scale = las_double(b, 131 + 8 * axis), offset = las_double(b, 155 + 8 * axis);
        assert_true(las_double(b, 179 + 16 * axis) == hi * scale + offset);
        assert_true(las_double(b, 187 + 16 * axis) == lo * scale + offset);
    }
}

static uint64_t check_las(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    const size_t begin = le_get32(whole->data + 96), row = le_get16(whole->data + 105), n = (left->len - begin) / row;
    const int minor = whole->data[25];
    expect_begin(whole, repaired, begin, n * row);
    assert_int_equal(minor == 2 ? le_get32(repaired->data + 107) : le_get64(repaired->data + 247), n);
    uint64_t n_returns = 0;
    for (int i = 0; i < (minor == 2 ? 5 : 15); i++)
        n_returns += minor == 2 ? le_get32(repaired->data + 111 + 4 * i) : le_get64(repaired->data + 255 + 8 * i);
    assert_int_equal(n_returns, n);
    check_las_bounds(repaired, begin, row, n);
    assert_string_equal((const char *)repaired->data + 58, "scanhead, its end is missing");
    return n;
}

static int is_no_las(const struct bytes *left)
{
    return left->len < 375 || left->len < le_get32(left->data + 96);
}

/* ---- the stream */

static size_t frame_len(const struct bytes *b, size_t at)
{
    return b->len - at < 28 ? SIZE_MAX : 28 + (size_t)le_get32(b->data + at + 4);
}

static uint64_t check_shs(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    size_t at = 0;
    uint64_t n = 0;
    for (; at < left->len && frame_len(left, at) <= left->len - at; n++)
        at += frame_len(left, at);
    expect_begin(whole, repaired, 0, at);
    return n;
}

static int is_no_shs(const struct bytes *left)
{
    return frame_len(left, 0) > left->len;
}

static size_t block_len(const struct bytes *b, size_t at)
{
    return b->len - at < 12 ? SIZE_MAX : le_get32(b->data + at + 4);
}

static uint64_t check_pcapng(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    size_t at = 0;
    uint64_t n = 0;
    while (at < left->len && block_len(left, at) <= left->len - at) {
        n += le_get32(left->data + at) == 6;
        at += block_len(left, at);
    }
    const struct bytes packets = {repaired->data, at};
    expect_begin(whole, &packets, 0, at);
    /* On a full disk the note has only the room of the part that is cut off, and may not fit. */
    const int is_full = left->len % 4096 == 0;
    if (is_full && repaired->len == at && left->len - at < 120) return n;
    const struct bytes note = {repaired->data + at, repaired->len - at}; /* a block of statistics with a comment */
    assert_true(note.len > 0 && note.len % 4 == 0 && block_len(&note, 0) == note.len && le_get32(note.data) == 5);
    assert_true(behind(&note, "incomplete: the recording was not completed") > 0);
    return n;
}

/* The second block, the interface, is not there. */
static int is_no_pcapng(const struct bytes *left)
{
    const size_t first = block_len(left, 0);
    return first > left->len || block_len(left, first) > left->len - first;
}

/* ---- .poses.csv */

static uint64_t check_poses(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    static const char last[] = "# incomplete: the recording was not completed; data may be missing after this\n";
    const size_t end = end_of_lines(left, 0);
    assert_true(repaired->len == end + sizeof last - 1);
    assert_memory_equal(repaired->data + end, last, sizeof last - 1);
    assert_memory_equal(repaired->data, whole->data, end);
    return count_lines(left->data, end) - 1;
}

static int is_no_poses(const struct bytes *left)
{
    return end_of_lines(left, 0) == 0;
}

/* ---- .e57: what is between the CRCs of its pages */

static struct bytes e57_content(const struct bytes *b)
{
    struct bytes c = {calloc(1, b->len + 1), 0};
    for (size_t at = 0; at + 1024 <= b->len; at += 1024, c.len += 1020)
        memcpy(c.data + c.len, b->data + at, 1020);
    return c;
}

/* Finds the next scan in the XML: its records, and the place of its section. Returns 0 where there is none. */
static int e57_scan(const char **xml, unsigned long long *n, size_t *section)
{
    unsigned long long offset;
    *xml = strstr(*xml, "<points type=\"CompressedVector\"");
    if (*xml == NULL) return 0;
    assert_int_equal(
        sscanf((*xml)++, "<points type=\"CompressedVector\" fileOffset=\"%llu\" recordCount=\"%llu\"", &offset, n), 2);
    *section = offset / 1024 * 1020 + offset % 1024;
    return 1;
}

static const char *e57_xml(const struct bytes *file, const struct bytes *content)
{
    const size_t at = le_get64(file->data + 24);
    return (const char *)content->data + at / 1024 * 1020 + at % 1024;
}

/* The packets of the whole file that end within the left one must be in the repaired one with the same bytes. */
static uint64_t check_e57(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    struct bytes w = e57_content(whole), r = e57_content(repaired);
    const char *w_xml = e57_xml(whole, &w), *r_xml = e57_xml(repaired, &r);
    const size_t there = left->len / 1024 * 1020;
    unsigned long long n, said;
    size_t section, again;
    uint64_t all = 0;
    assert_non_null(strstr(r_xml, "; repaired: its end is missing</description>"));
    while (e57_scan(&w_xml, &n, &section) && section + 32 <= there) {
        unsigned long long kept = 0, before = 0;
        size_t at = section + 32;
        while (before < n) {
            const size_t len = le_get16(w.data + at + 2) + (size_t)1;
            before += le_get16(w.data + at + 6) / 4; /* the first stream has 4 bytes a record */
            at += len;
            if (at > there) break;
            assert_memory_equal(r.data + at - len, w.data + at - len, len);
            kept = before;
        }
        assert_true(e57_scan(&r_xml, &said, &again));
        assert_int_equal(said, kept);
        assert_int_equal(again, section);
        all += kept;
    }
    assert_false(e57_scan(&r_xml, &said, &again));
    free(w.data);
    free(r.data);
    return all;
}

/* The file's first note (288 bytes from 48 on) and header (32), which are in the first page, are not there. */
static int is_no_e57(const struct bytes *left)
{
    return left->len < 1024 || memcmp(left->data + 64, "scanhead e57 1", 15) != 0;
}

/* ---- .ptx, and the grid beside it: a head of 120 bytes, cells of 40 */

/* Returns the next point of a text, and moves on to after its newline; NULL: there is no other. Lines of four numbers
 * are points, but also the last lines of a header, which end in 0 or 1. */
static const char *ptx_point(const char *at, const char *end, size_t *len)
{
    for (const char *stop; at < end && (stop = memchr(at, '\n', (size_t)(end - at))) != NULL; at = stop + 1) {
        int spaces = 0;
        for (const char *c = at; c < stop; c++)
            spaces += *c == ' ';
        *len = (size_t)(stop - at);
        const int is_matrix = spaces == 3 && stop[-2] == ' ';
        if (spaces == 3 && !is_matrix && strncmp(at, "0 0 0 0.5", 9) != 0) return at;
    }
    return NULL;
}

static uint64_t ptx_points(const struct bytes *b, size_t len)
{
    const char *at = (const char *)b->data, *end = at + (len < b->len ? len : b->len);
    uint64_t n = 0;
    for (size_t l; (at = ptx_point(at, end, &l)) != NULL; at += l)
        n++;
    return n;
}

static uint64_t check_ptx(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    const int has_grid = repair_beside.len >= 160;
    uint64_t n = ptx_points(left, has_grid ? le_get64(repair_beside.data + 8) : left->len);
    for (size_t at = 120; has_grid && at + 40 <= repair_beside.len; at += 40) {
        float shine;
        memcpy(&shine, repair_beside.data + at + 8, sizeof shine);
        n += shine >= 0;
    }
    assert_int_equal(ptx_points(repaired, repaired->len), n);
    const char *w = (const char *)whole->data, *w_end = w + whole->len;
    const char *r = (const char *)repaired->data, *r_end = r + repaired->len;
    for (size_t l, k; (r = ptx_point(r, r_end, &l)) != NULL; r += l, w += k) {
        w = ptx_point(w, w_end, &k);
        assert_true(w != NULL && k == l && memcmp(w, r, l) == 0);
    }
    return n;
}

static int is_no_ptx(const struct bytes *left)
{
    return repair_beside.len < 160 && ptx_points(left, left->len) == 0;
}

struct bytes repair_beside;

const char *repair_row_beside(const struct repair_row *row)
{
    return strcmp(row->ending, ".ptx") == 0 ? ".grid" : NULL;
}

#define CLOUDCOMPARE                                                                                          \
    {                                                                                                         \
        "sh", "-c",                                                                                           \
            "rm -f *.asc; CloudCompare -SILENT -NO_TIMESTAMP -O -GLOBAL_SHIFT AUTO \"$F\" -C_EXPORT_FMT ASC " \
            "-SAVE_CLOUDS >/dev/null && cat *.asc && rm *.asc"                                                \
    }

/* npm's reader. Count and bounds come first. Status 127: it is not installed. */
#define LOADERS_GL                                                                                                                \
    {                                                                                                                             \
        "sh", "-c",                                                                                                               \
            "[ -e \"$READERS/installed\" ] || exit 127; node --experimental-wasm-modules \"$READERS/las.mjs\" \"$F\" las.xyz && " \
            "tail -n +3 las.xyz && rm las.xyz"                                                                                    \
    }

/* READERS is an absolute path, which the harness sets. */
#define WEB_E57 \
    "[ -e \"$READERS/installed\" ] || exit 127; node --experimental-wasm-modules \"$READERS\"/e57.mjs \"$F\" e57.xyz && cat e57.xyz && rm e57.xyz"

const struct repair_row repair_cases[] = {
    {"stream", ".shs", {NULL}, {NULL}, check_shs, is_no_shs},
    {"packets", ".pcapng", {NULL}, {"tshark", "-r", "$F"}, check_pcapng, is_no_pcapng},
    {"points", ".ply", {NULL}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"few", ".ply", {"--ply-columns", "xyz"}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"colours", ".ply", {"--colour", "label", "--ply-names", "cloudcompare"}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"text", ".ply", {"--ascii", "--empty-shots"}, {NULL}, check_ply_text, is_no_ply},
    {"points", ".las", {NULL}, LOADERS_GL, check_las, is_no_las},
    {"colours", ".las", {"--colour", "label"}, LOADERS_GL, check_las, is_no_las},
    {"old", ".las", {"--las-version", "1.2"}, LOADERS_GL, check_las, is_no_las},
    {"stations", ".poses.csv", {NULL}, {NULL}, check_poses, is_no_poses},
    {"scans", ".e57", {NULL}, {"sh", "-c", WEB_E57}, check_e57, is_no_e57},
    {"shots", ".e57", {"--empty-shots", "--colour", "label"}, {NULL}, check_e57, is_no_e57},
    {"grids", ".ptx", {NULL}, CLOUDCOMPARE, check_ptx, is_no_ptx},
};
const size_t n_repair_cases = sizeof repair_cases / sizeof repair_cases[0];
