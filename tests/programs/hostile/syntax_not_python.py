Sure! Here is the code you asked for:
```python
go_home()
```
