#include "tests/wire/repair_rows.h"

#include "drivers/protocol/bytes.h"

/* Behind this text; 0: it is not there. */
static size_t behind(const struct bytes *b, const char *text)
{
    const uint8_t *at = memmem(b->data, b->len, text, strlen(text));
    return at != NULL ? (size_t)(at - b->data) + strlen(text) : 0;
}

/* From `begin` on, the repaired file has the first `len` bytes of the whole one, and nothing else. */
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

/* Behind the last newline. */
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
    const int is_full = left->len % 4096 == 0; /* a disk of whole pages: what is cut is all the room for a note */
    if (is_full && repaired->len == at && left->len - at < 120) return n;
    const struct bytes note = {repaired->data + at, repaired->len - at}; /* a block of statistics with a comment */
    assert_true(note.len > 0 && note.len % 4 == 0 && block_len(&note, 0) == note.len && le_get32(note.data) == 5);
    assert_true(behind(&note, "incomplete: the recorder came to no end") > 0);
    return n;
}

/* Without its second block, the interface. */
static int is_no_pcapng(const struct bytes *left)
{
    const size_t first = block_len(left, 0);
    return first > left->len || block_len(left, first) > left->len - first;
}

/* ---- .poses.csv */

static uint64_t check_poses(const struct bytes *whole, const struct bytes *left, const struct bytes *repaired)
{
    static const char last[] = "# incomplete: the recorder came to no end; what should follow may be missing\n";
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

#define CLOUDCOMPARE                                                                                          \
    {                                                                                                         \
        "sh", "-c",                                                                                           \
            "rm -f *.asc; CloudCompare -SILENT -NO_TIMESTAMP -O -GLOBAL_SHIFT AUTO \"$F\" -C_EXPORT_FMT ASC " \
            "-SAVE_CLOUDS >/dev/null && cat *.asc && rm *.asc"                                                \
    }

const struct repair_row repair_rows[] = {
    {"stream", ".shs", {NULL}, {NULL}, check_shs, is_no_shs},
    {"packets", ".pcapng", {NULL}, {"tshark", "-r", "$F"}, check_pcapng, is_no_pcapng},
    {"points", ".ply", {NULL}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"few", ".ply", {"--ply-columns", "xyz"}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"colours", ".ply", {"--colour", "label", "--ply-names", "cloudcompare"}, CLOUDCOMPARE, check_ply, is_no_ply},
    {"text", ".ply", {"--ascii", "--empty-shots"}, {NULL}, check_ply_text, is_no_ply},
    {"points", ".las", {NULL}, CLOUDCOMPARE, check_las, is_no_las},
    {"colours", ".las", {"--colour", "label"}, {NULL}, check_las, is_no_las},
    {"old", ".las", {"--las-version", "1.2"}, CLOUDCOMPARE, check_las, is_no_las},
    {"stations", ".poses.csv", {NULL}, {NULL}, check_poses, is_no_poses},
};
const size_t n_repair_rows = sizeof repair_rows / sizeof repair_rows[0];
