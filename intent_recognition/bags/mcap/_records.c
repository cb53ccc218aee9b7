/* SPDX-License-Identifier: Apache-2.0
 *
 * Where the records of an MCAP chunk begin. `records.py` says the same in Python, and calls this.
 */
#define PY_SSIZE_T_CLEAN
#include <Python.h>
#include <stdint.h>

/* The number that eight bytes are, the lowest first. */
static uint64_t number(const unsigned char *at) {
    uint64_t found = 0;
    for (int k = 7; k >= 0; k--) found = found << 8 | at[k];
    return found;
}

/* positions(data, out, head, message, least): writes where records begin to `out`, of int64; how many there are, and where
 * the last whole one ends, -1 where a message has less than `least` bytes. */
static PyObject *positions(PyObject *module, PyObject *arguments) {
    Py_buffer data, out;
    Py_ssize_t head, message, least, end = 0, n = 0;
    if (!PyArg_ParseTuple(arguments, "y*w*nnn:positions", &data, &out, &head, &message, &least)) return NULL;
    const unsigned char *bytes = data.buf;
    int64_t *found = out.buf;
    while (head >= 9 && end >= 0 && end <= data.len - head && n < out.len / 8) {
        uint64_t length = number(bytes + end + 1);
        if (length > (uint64_t)(data.len - head - end)) break;
        found[n++] = end;
        end = bytes[end] == message && length < (uint64_t)least ? -1 : end + head + (Py_ssize_t)length;
    }
    PyBuffer_Release(&data);
    PyBuffer_Release(&out);
    return Py_BuildValue("nn", n, end);
}

static PyMethodDef methods[] = {{"positions", positions, METH_VARARGS, NULL}, {NULL, NULL, 0, NULL}};
static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_records", NULL, 0, methods, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit__records(void) { return PyModule_Create(&module); }
