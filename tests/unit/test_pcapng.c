/* pcapng, block by block: every frame is a packet with its bytes and its device time. */
#include "tests/unit/recorder_rig.h"

static void put_event(int64_t t_ns, const char *text)
{
    uint8_t out[256];
    struct native_event e = {.code = NATIVE_EV_STATE};
    snprintf(e.text, sizeof e.text, "%s", text);
    rig_put(out, native_encode_event(out, sizeof out, &e, t_ns, 0));
}

static void test_packets(void **state)
{
    (void)state;
    static const int64_t t_ns[3] = {0, 0x123456789abcd, 5};
    struct sh_err err = {0};
    const char *path = rig_path("a.pcapng");
    size_t len, stream_len;
    rig_begin();
    for (int i = 0; i < 3; i++)
        put_event(t_ns[i], "state");
    assert_int_equal(rig_record(path, (struct recorder_options){0}, RIG_KEEP, &err), 0);
    uint8_t *file = rig_read(path, &len), *stream = rig_read(rig_shs, &stream_len), *at = file, *frame = stream;
    unlink(path);
    for (int block = 0; at < file + len; block++) {
        uint32_t block_len = (uint32_t)rig_uint(at + 4, 4);
        assert_int_equal(block_len % 4, 0);
        assert_int_equal(rig_uint(at + block_len - 4, 4), block_len);
        assert_int_equal(rig_uint(at, 4), block == 0 ? 0x0a0d0d0a : block == 1 ? 1 : 6);
        if (block == 0) assert_int_equal(rig_uint(at + 8, 4), 0x1a2b3c4d);
        if (block == 1) assert_int_equal(rig_uint(at + 8, 2), 147);
        if (block >= 2) {
            uint32_t n = (uint32_t)rig_uint(at + 20, 4);
            assert_int_equal(rig_uint(at + 12, 4) << 32 | rig_uint(at + 16, 4), t_ns[block - 2]);
            assert_int_equal(rig_uint(at + 24, 4), n);
            assert_true(frame + n <= stream + stream_len);
            assert_memory_equal(at + 28, frame, n);
            frame += n;
        }
        at += block_len;
    }
    assert_ptr_equal(at, file + len);
    assert_ptr_equal(frame, stream + stream_len);
    free(file);
    free(stream);
}

static void test_disk_full(void **state)
{
    (void)state;
    rig_begin();
    for (int i = 0; i < 100; i++)
        put_event(i, "state");
    rig_check_disk_full(rig_path("full.pcapng"), 3000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_packets), cmocka_unit_test(test_disk_full)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
