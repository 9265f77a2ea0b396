/* SPDX-License-Identifier: MIT */
/* E57 files whose recorder was killed, or whose disk was full: the result of a repair, wherever they end. */
#include "tests/unit/killed_e57_rig.h"

enum { MAX_PACKETS = 128, MAX_SCANS = 4 };

/* The complete recording, by its XML and the lengths of its packets: where each scan's packets begin, where each packet
 * ends, and the records up to there. Places count the bytes without the pages' CRCs. */
static struct {
    size_t end, n;
    int scan;
} packet[MAX_PACKETS];
static int n_packets, n_scans;
static const char MISSING[] = KILLED_E57_MISSING;
static size_t scan_begin[MAX_SCANS];

static size_t logical(size_t physical)
{
    return physical / PAGE * CONTENT + physical % PAGE;
}

static const uint8_t *at_logical(const uint8_t *file, size_t at)
{
    return file + at / CONTENT * PAGE + at % CONTENT;
}

static uint16_t word_at(const uint8_t *file, size_t at)
{
    return (uint16_t)(*at_logical(file, at) | *at_logical(file, at + 1) << 8);
}

static void find_packets(void)
{
    const char *at = e57rig_xml;
    n_packets = n_scans = 0;
    for (; (at = strstr(at, "<points type=\"CompressedVector\"")) != NULL; at++, n_scans++) {
        unsigned long long offset, count;
        size_t p, n = 0;
        assert_int_equal(
            sscanf(at, "<points type=\"CompressedVector\" fileOffset=\"%llu\" recordCount=\"%llu\"", &offset, &count),
            2);
        p = scan_begin[n_scans] = logical(offset) + 32;
        do {
            n += word_at(killed_e57.whole, p + 6) / 4u; /* the first stream has 4 bytes a record */
            p += word_at(killed_e57.whole, p + 2) + (size_t)1;
            assert_true(n_packets < MAX_PACKETS);
            packet[n_packets].end = p;
            packet[n_packets].n = n;
            packet[n_packets++].scan = n_scans;
        } while (n < count);
        assert_int_equal(n, count);
    }
}

static bool empty_shots, coloured; /* in the recorded files */

static void record_scans(bool has_third, bool with_empty_shots, bool with_colours)
{
    empty_shots = with_empty_shots;
    coloured = with_colours;
    killed_e57_record(has_third, empty_shots, coloured);
    find_packets();
    assert_int_equal(n_scans, 3);
}

/* Counts the scans and packets that the first `len` bytes hold. */
static void expect_of(size_t len, int *scans, int *packets)
{
    const size_t there = len / PAGE * CONTENT;
    for (*scans = 0; *scans < n_scans && scan_begin[*scans] <= there;)
        ++*scans;
    for (*packets = 0; *packets < n_packets && packet[*packets].end <= there;)
        ++*packets;
}

static struct e57rig_record *truth; /* of the complete file, scan by scan */
static size_t truth_from[MAX_SCANS + 1];

static void read_truth(void)
{
    const char *path = rig_path("a.e57");
    free(truth);
    truth = NULL;
    killed_rig_write(path, killed_e57.whole, killed_e57.whole_len);
    e57rig_read(path);
    for (int k = 0; k < n_scans; k++) {
        e57rig_scan(k, empty_shots, coloured);
        truth_from[k + 1] = truth_from[k] + e57rig_n_records;
        truth = realloc(truth, truth_from[k + 1] * sizeof *truth);
        memcpy(truth + truth_from[k], e57rig_record, e57rig_n_records * sizeof *truth);
    }
    unlink(path);
}

/* The XML's bounds are those of the records. */
static void check_bounds(const char *xml)
{
    double low = INFINITY, high = -INFINITY, faint = INFINITY, bright = -INFINITY;
    uint32_t row_max = 0, column_max = 0;
    for (size_t i = 0; i < e57rig_n_records; i++) {
        const struct e57rig_record *r = &e57rig_record[i];
        if (r->row > row_max) row_max = r->row;
        if (r->column > column_max) column_max = r->column;
        if (r->invalid != 0) continue;
        low = fmin(low, r->x);
        high = fmax(high, r->x);
        if (r->no_intensity == 0) faint = fmin(faint, r->intensity);
        if (r->no_intensity == 0) bright = fmax(bright, r->intensity);
    }
    if (e57rig_n_records == 0) return;
    assert_true(fabs(e57rig_number(xml, "xMinimum") - low) < 1e-9 &&
                fabs(e57rig_number(xml, "xMaximum") - high) < 1e-9);
    assert_true(fabs(e57rig_number(xml, "intensityMinimum") - faint) < 1e-9 &&
                fabs(e57rig_number(xml, "intensityMaximum") - bright) < 1e-9);
    assert_true(e57rig_number(xml, "rowMaximum") == row_max && e57rig_number(xml, "columnMaximum") == column_max);
}

/* The file has exactly the first records of each scan, and as many scans. */
static void check_file(const char *path, int scans, int packets)
{
    size_t n[MAX_SCANS] = {0};
    for (int i = 0; i < packets; i++)
        n[packet[i].scan] = packet[i].n;
    e57rig_read(path);
    const char *child = e57rig_xml;
    for (int k = 0; k < scans; k++) {
        child = strstr(child + 1, "<vectorChild");
        assert_non_null(child);
        e57rig_scan(k, empty_shots, coloured);
        assert_int_equal(e57rig_n_records, n[k]);
        assert_memory_equal(e57rig_record, truth + truth_from[k], n[k] * sizeof *truth);
        check_bounds(child);
    }
    assert_null(strstr(child + 1, "<vectorChild"));
}

static int already_seen(int scans, int packets, const uint8_t *file, size_t len)
{
    static uint8_t *seen[MAX_SCANS + 1][MAX_PACKETS + 1];
    static size_t seen_len[MAX_SCANS + 1][MAX_PACKETS + 1];
    if (file == NULL) { /* forget them */
        for (int s = 0; s <= MAX_SCANS; s++)
            for (int p = 0; p <= MAX_PACKETS; p++) {
                free(seen[s][p]);
                seen[s][p] = NULL;
            }
        return 0;
    }
    if (seen[scans][packets] != NULL) {
        assert_true(len == seen_len[scans][packets] && memcmp(file, seen[scans][packets], len) == 0);
        return 1;
    }
    seen[scans][packets] = malloc(len);
    memcpy(seen[scans][packets], file, len);
    seen_len[scans][packets] = len;
    return 0;
}

/* Counts the bytes at the end that belong to no whole packet. Zeros of the last page and the XML don't count. */
static size_t cut_of(const uint8_t *from, size_t len, int scans, int packets)
{
    const size_t there = len / PAGE * CONTENT, begin = scan_begin[scans - 1];
    const size_t end = packets > 0 && packet[packets - 1].end > begin ? packet[packets - 1].end : begin;
    size_t at = end;
    while (at < there && *at_logical(from, at) == 0)
        at++;
    if (at == there) return len % PAGE;
    return *at_logical(from, end) == '<' ? 0 : len - (size_t)(at_logical(from, end) - from);
}

/* Cuts that leave the same packets give the same file, so it is read once. */
static void check_cut(const char *path, const uint8_t *from, size_t len)
{
    struct repair repair;
    struct sh_err err;
    int scans, packets;
    size_t n = 0, now, again_len;
    expect_of(len, &scans, &packets);
    killed_rig_write(path, from, len);
    int rc = killed_rig_repair(path, &repair, &err);
    if (scans == 0) {
        assert_int_equal(rc, SH_EFORMAT);
        assert_non_null(strstr(err.text, "no scan begins in it"));
        return;
    }
    if (rc != 0) fail_msg("%zu bytes: %s", len, err.text);
    for (int i = 0; i < packets; i++)
        n += packet[i].n - (i > 0 && packet[i - 1].scan == packet[i].scan ? packet[i - 1].n : 0);
    assert_int_equal(repair.n_kept, n);
    assert_int_equal(repair.n_scans, scans);
    assert_int_equal(repair.was_whole, from == killed_e57.whole && len == killed_e57.whole_len);
    if (!repair.was_whole) assert_int_equal(repair.cut_bytes, cut_of(from, len, scans, packets));
    uint8_t *file = rig_read(path, &now);
    if (repair.was_whole) {
        assert_memory_equal(file, killed_e57.whole, killed_e57.whole_len);
        free(file);
        return;
    }
    if (!already_seen(scans, packets, file, now)) {
        check_file(path, scans, packets);
        assert_non_null(strstr(e57rig_xml, MISSING));
        assert_int_equal(killed_rig_repair(path, &repair, &err), 0);
        assert_true(repair.was_whole && repair.n_kept == n);
        uint8_t *again = rig_read(path, &again_len);
        assert_true(again_len == now && memcmp(again, file, now) == 0);
        free(again);
    }
    free(file);
}

/* Files are cut at each page's end, since the result changes only there, and one byte before it. */
static void test_cuts(void **state)
{
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        const char *path = rig_path("cut.e57");
        record_scans(true, kind > 0, kind > 1);
        read_truth();
        for (size_t len = 0; len <= killed_e57.left_len; len += len % PAGE == 0 ? PAGE - 1 : 1)
            check_cut(path, killed_e57.left, len);
        already_seen(0, 0, NULL, 0);
        unlink(path);
    }
}

/* Returns the XML without the note of the repair; free() it. */
static char *xml_of(const char *path)
{
    e57rig_read(path);
    char *xml = strdup(e57rig_xml), *at = strstr(xml, MISSING);
    if (at != NULL) memmove(at, at + sizeof MISSING - 1, strlen(at + sizeof MISSING - 1) + 1);
    return xml;
}

/* The file is a whole one whose end is missing, or one that was being completed. Once all points are there, the same
 * file comes out, with the note that its end is missing. */
static void test_end(void **state)
{
    (void)state;
    const char *path = rig_path("cut.e57");
    struct repair repair;
    struct sh_err err;
    record_scans(true, false, false);
    read_truth();
    for (size_t cut = 0; cut < killed_e57.whole_len; cut += PAGE)
        check_cut(path, killed_e57.whole, killed_e57.whole_len - cut);
    already_seen(0, 0, NULL, 0);
    killed_rig_write(path, killed_e57.whole, killed_e57.whole_len);
    char *want = xml_of(path);
    const size_t end = packet[n_packets - 1].end / CONTENT * PAGE; /* pages before the XML */
    for (int header = 0; header < 2; header++) { /* all headers are missing; then only the file's own */
        size_t len;
        uint8_t *part = malloc(killed_e57.whole_len);
        memcpy(part, killed_e57.whole, killed_e57.whole_len);
        memcpy(part, killed_e57.left, header ? PAGE : killed_e57.left_len / PAGE * PAGE - PAGE);
        killed_rig_write(path, part, killed_e57.whole_len - (header ? 0 : 1));
        assert_int_equal(killed_rig_repair(path, &repair, &err), 0);
        assert_true(!repair.was_whole && repair.cut_bytes == 0);
        free(part);
        char *xml = xml_of(path);
        assert_string_equal(xml, want);
        free(xml);
        part = rig_read(path, &len);
        assert_memory_equal(part + PAGE, killed_e57.whole + PAGE, end - PAGE);
        free(part);
    }
    free(want);
    unlink(path);
}

/* A scan that has begun has a packet, though it may be empty: other readers look for one at its beginning. Where all
 * shots of the last scan are left out, a repair makes the file that its recorder makes. */
static void test_empty_scan(void **state)
{
    (void)state;
    const char *path = rig_path("cut.e57");
    struct repair repair;
    struct sh_err err;
    record_scans(false, false, false);
    killed_rig_write(path, killed_e57.whole, killed_e57.whole_len);
    char *want = xml_of(path);
    e57rig_scan(2, 0, 0);
    assert_true(e57rig_n_records == 0 && e57rig_n_packets == 1);
    killed_rig_write(path, killed_e57.left, killed_e57.left_len);
    assert_int_equal(killed_rig_repair(path, &repair, &err), 0);
    assert_true(!repair.was_whole && repair.n_scans == 3);
    char *xml = xml_of(path);
    assert_string_equal(xml, want);
    e57rig_scan(2, 0, 0);
    assert_true(e57rig_n_records == 0 && e57rig_n_packets == 1);
    free(xml);
    free(want);
    unlink(path);
}

static int tear_down(void **state)
{
    killed_e57_free();
    free(truth);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cuts),
        cmocka_unit_test(test_end),
        cmocka_unit_test(test_empty_scan),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
